"""Why a contour has nothing, or no more: one line, in the message, on the terminal and in the mapper's status."""

import math
from pathlib import Path

import numpy as np
import pytest
from mapper.command import noctule_mapper
from mapper.fixed_units import survey_fixed
from mapper.live_site import paper_survey
from mapper.room import Room, message_of

from noctule import survey
from noctule.messages_pb2 import READING_STATUS_NO_ECHO, READING_STATUS_STUCK_HIGH, Sweep
from noctule_mapper.live.refused import RefusedSweeps
from noctule_mapper.live.troubles import ShowEvent
from noctule_mapper.readings.sweep import SweepError
from noctule_mapper.survey_fit import fit

RECTANGLE = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
# Of coarse sweeps, as README's "By hand" has them: from 0.65 m on two stops make a wall.
ONE_PLACE = "echoes from 1 place; a wall needs 3 (2 if over 0.65 m apart), a cylinder 3"
STANDS = np.array([(0.3, 0.6, 0.5), (3.5, 2.6, -2.2)])


def fixed(stands: np.ndarray) -> list[Sweep]:
    made = [message_of(one.sweep, 20.0) for one in survey_fixed(RECTANGLE, stands, np.random.default_rng(2))]
    for number, one in enumerate(made):
        one.log_id, one.log_sequence = f"log of {one.unit}", number
    return made


def silent(status: int, x_m: float = 0.0) -> Sweep:
    made = Sweep(site="s", unit="u1", log_id="log", log_sequence=int(10 * x_m))
    made.pose.x_m = x_m
    for step in range(5):
        made.readings.add(bearing_rad=math.radians(20.0 * step), status=status)
    return made


def echo(x_m: float) -> Sweep:
    made = silent(READING_STATUS_NO_ECHO, x_m)
    made.readings.add(bearing_rad=-0.5, time_of_flight_s=0.005 + 0.003 * x_m)
    return made


@pytest.mark.parametrize(
    ("sweeps", "note"),
    [
        ([], "no sweeps"),
        ([silent(READING_STATUS_NO_ECHO)], "no echo anywhere in 1 sweep"),
        ([silent(READING_STATUS_NO_ECHO), silent(READING_STATUS_NO_ECHO, 1.0)], "no echo anywhere in 2 sweeps"),
        ([silent(READING_STATUS_STUCK_HIGH)], "no usable reading in 1 sweep: see the states of the units"),
        ([echo(0.0)], ONE_PLACE),
        ([echo(0.0), echo(0.5)], "echoes from 2 places; a wall needs 3, a cylinder 3"),
        ([echo(0.0), echo(1.0)], "echoes from 2 places; a cylinder needs 3"),
        (
            [echo(0.0), echo(1.0), echo(2.0)],
            "echoes from 3 places, but no wall and no cylinder explains enough of them: add places, or check the poses",
        ),
        (
            fixed(STANDS[[0, 0]]),  # right angles alone tell its walls
            "echoes from 1 place; a cylinder needs 3; 2 may do, best on opposite sides of it. "
            "2 units state the same pose: give each its own in the site file",
        ),
        (fixed(STANDS), "echoes from 2 places; a cylinder needs 3; 2 may do, best on opposite sides of it"),
        (paper_survey(), ""),
    ],
)
def test_a_contour_says_what_it_lacks(sweeps: list[Sweep], note: str) -> None:
    assert fit(sweeps).note == note


def test_what_is_lacking_is_printed_by_fit_and_export(tmp_path: Path) -> None:
    source = tmp_path / "survey.jsonl"
    with source.open("w") as stream:
        survey.write([echo(0.0)], stream)
    for command in (("fit", source, "--contour", tmp_path / "contour.json"), ("export", source, tmp_path / "a.dxf")):
        result = noctule_mapper(*command)
        assert result.output.splitlines()[-1] == ONE_PLACE
    again = noctule_mapper("export", tmp_path / "contour.json", tmp_path / "a.dxf")
    assert again.output.splitlines()[-1] == ONE_PLACE


def kept_in(events: list[str]) -> ShowEvent:
    def show(text: str, level: str = "INFO") -> None:
        assert level == "WARN"
        events.append(text)

    return show


def test_refused_sweeps_are_logged_once_for_each_unit_and_kind_and_counted_in_the_status() -> None:
    events: list[str] = []
    refused = RefusedSweeps(kept_in(events))
    for number in range(1, 4):
        refused.refuse("u7", SweepError(f"sweep {number} of 'a': stuck", "stuck sensor"))
        refused.accept("u7")
    refused.refuse("u7", SweepError("sweep 9 of 'a' has no pose", "no pose"))
    assert events == ["sweep 1 of 'a': stuck", "sweep 9 of 'a' has no pose"]
    assert refused.detail() == "4 sweeps of u7 left out, the last: sweep 9 of 'a' has no pose"
    for _ in range(10):
        refused.accept("u7")
    assert (refused.detail(), refused.count()) == ("", 4)


def test_a_status_names_a_few_of_many_units() -> None:
    refused = RefusedSweeps(kept_in([]))
    for unit in range(9):
        refused.refuse(f"u{unit}", SweepError("sweep 1: stuck", "stuck sensor"))
    assert refused.detail().endswith("; and sweeps of 4 more units")
