"""Every process can be killed and started again on its own, and nothing measured is lost."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from system.processes import programs
from system.site import SITE, SURVEY_SWEEPS, PaperRoom, paper_room, wait_for_contour, wait_for_sweeps

from noctule import survey
from noctule.client import Client
from noctule.messages_pb2 import Contour, Sweep
from noctule_mapper.config import MapperConfig
from noctule_mapper.survey_fit import fit

SAME_M = 1e-3  # a refit from the same sweeps differs by rounding alone; a missing sweep moves walls by more


def test_a_gateway_and_a_mapper_killed_in_mid_survey_lose_no_sweep_and_end_with_the_same_map(tmp_path: Path) -> None:
    room = paper_room(tmp_path)
    with programs(tmp_path) as running:
        running.start("simulator", *room.simulator(speed=16))
        running.start("gateway", *room.gateway())
        running.start("mapper", *room.mapper())

        wait_for_sweeps(room, running, 12)
        running.kill("gateway")
        running.start("gateway", *room.gateway())

        wait_for_sweeps(room, running, 26)
        running.kill("mapper")
        running.start("mapper", *room.mapper())

        contour = wait_for_contour(room, running)
        sweeps = logged_sweeps(room)
        for name in ("mapper", "gateway", "simulator"):
            assert running.end(name) == 0, running.log(name)

    assert [sweep.log_sequence for sweep in sweeps] == list(range(1, SURVEY_SWEEPS + 1))
    assert [sweep.sequence for sweep in sweeps] == list(range(SURVEY_SWEEPS))
    assert [sweep.waypoint for sweep in sweeps] == list(range(SURVEY_SWEEPS))
    assert_same_map(contour, fit(sweeps, MapperConfig()))


def logged_sweeps(room: PaperRoom) -> Sequence[Sweep]:
    """Every sweep of the gateway's log, in its order."""
    with Client(SITE, connect=[room.connect]) as client:
        records = client.log("u1", from_sequence=1)
    assert records is not None
    return records.sweeps


def assert_same_map(live: Contour, expected: Contour) -> None:
    """The maps have the same objects in the same places."""
    assert len(live.walls) == len(expected.walls)
    assert len(live.cylinders) == len(expected.cylinders)
    for kind in ("corners", "cylinders"):
        points = sorted((each.x_m, each.y_m) for each in getattr(live, kind))
        wanted = sorted((each.x_m, each.y_m) for each in getattr(expected, kind))
        assert points == [pytest.approx(point, abs=SAME_M) for point in wanted], survey.to_json(live)
