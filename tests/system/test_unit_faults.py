"""The real firmware with a broken part: its gateway names what is wrong within three sweeps, and nothing before."""

from pathlib import Path

import pytest
from firmware.stepped_unit import stepped_unit
from rooms import site_file
from system.lockstep import CLEAN, Lockstep

from noctule.messages_pb2 import (
    FAULT_KIND_MOTOR_STUCK,
    FAULT_KIND_NO_SENSOR,
    FAULT_KIND_REPEATS,
    FAULT_KIND_SILENT,
    FAULT_KIND_SLIPPED,
    FAULT_KIND_STUCK_HIGH,
    FAULT_KIND_TOO_EARLY,
    FAULT_KIND_TURNED,
    FaultKind,
    Sweep,
)
from noctule.site import FixedPose, Site, load
from noctule_gateway.clock.boot_clocks import SweepTime
from noctule_gateway.clock.regression import HostTime
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.unit.plans import wanted_plan
from noctule_gateway.unit.sweep_health import SweepHealth
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import AnySweep, Start
from noctule_gateway.wire.sweep_message import to_message

TICKS_PER_S = 4e6  # firmware/README.md, "Frames"
LEARNT_AFTER = 14  # sweeps
FACING_RAD = 0.02  # a bearing that answers is 0.08 from the next
WITHIN_S = 40.0  # a fine sweep takes 10.5 s (gateway/README.md)


@pytest.fixture
def lounge(tmp_path: Path) -> Site:
    path = tmp_path / "site.toml"
    path.write_text(site_file("lounge", unit_port=30_000))
    return load(path)


class Gateway:
    """What a gateway makes of the sweeps that have arrived, as far as its health goes."""

    def __init__(self, site: Site, folder: Path) -> None:
        self._site, self._unit = site, site.unit("u1")
        self.health = SweepHealth(self._unit, site.name, folder / "u1.sqlite")
        self.judged: list[Sweep] = []

    def take(self, sweep: AnySweep) -> Sweep:
        assert isinstance(self._unit.pose, FixedPose)
        when = SweepTime(HostTime(1.8e9 + sweep.start / TICKS_PER_S, 0.001), None, 1.0)
        message = to_message(sweep, self._site, self._unit, when, self._unit.pose.pose.message())
        self.health.judge(message, encode(sweep))
        self.judged.append(message)
        return message


@pytest.mark.parametrize(
    ("fault", "kind", "by"),
    [
        ({"kind": "sensor_deaf"}, FAULT_KIND_SILENT, 3),
        ({"kind": "sensor_missing"}, FAULT_KIND_NO_SENSOR, 3),
        ({"kind": "sensor_stuck_high"}, FAULT_KIND_STUCK_HIGH, 3),
        ({"kind": "sensor_short_pulse"}, FAULT_KIND_TOO_EARLY, 3),
        ({"kind": "sensor_repeats", "echo_ms": 7.2}, FAULT_KIND_REPEATS, 3),
        ({"kind": "motor_stuck"}, FAULT_KIND_MOTOR_STUCK, 3),
        ({"kind": "motor_loses_steps", "probability": 0.02}, FAULT_KIND_SLIPPED, 3),
        ({"kind": "sensor_turned", "by_deg": 9.0}, FAULT_KIND_TURNED, 5),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_broken_part_is_named_in_time(lounge: Site, tmp_path: Path, fault: dict, kind: FaultKind, by: int) -> None:
    plan = wanted_plan(lounge.unit("u1"))
    link = Link(serial=1, wanted=Wanted(plan, Start(0, 0), running=True), first_request=0)
    gateway = Gateway(lounge, tmp_path)
    with stepped_unit("--room", "lounge", "--units", "1") as unit:
        cable = Lockstep(unit, link, CLEAN, seed=1)
        arrived = cable.tally.arrived

        def judge_next() -> Sweep:
            count = len(gateway.judged)
            cable.wait_for(lambda: len(arrived) > count, WITHIN_S)
            return gateway.take(arrived[count])

        while len(gateway.judged) < LEARNT_AFTER:
            assert not judge_next().faults
        if fault["kind"] == "motor_stuck":
            wall_rad = facing(gateway.judged)
            while abs(unit.truth["bearing_rad"] - wall_rad) > FACING_RAD:
                cable.run(0.05)
            while len(gateway.judged) < len(arrived):
                assert not judge_next().faults
        unit.inject(**fault)
        for _ in range(by):
            sweep = judge_next()
            if sweep.faults:
                break
        assert [FaultKind.Name(one) for one in sweep.faults] == [FaultKind.Name(kind)]
        assert 1 <= sweep.suspect_before <= by
        (found,) = gateway.health.faults("")
        assert (found.kind, found.confidence > 0.5, bool(found.words), bool(found.advice)) == (kind, True, True, True)
        unit.inject("mended")


def facing(judged: list[Sweep]) -> float:
    """A bearing that has answered in each sweep: a motor that is stuck where nothing answers is as good as deaf."""
    answers = [
        {round(one.bearing_rad, 2) for one in sweep.readings if one.HasField("time_of_flight_s")} for sweep in judged
    ]
    always = sorted(set.intersection(*answers))
    return always[len(always) // 2]
