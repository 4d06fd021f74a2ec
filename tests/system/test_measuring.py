"""A unit measures itself on the bus: what its gateway says of gear, play and parts, and the report that is filed."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from system.processes import PATIENCE_S, Programs, free_ports, listens, programs, wait_until

from noctule.client import Client
from noctule.messages_pb2 import FAULT_KIND_SLIPPED, Sweep, UnitStatus

SPEED = 30
IDLE, SWEEPING = UnitStatus.STATE_IDLE, UnitStatus.STATE_SWEEPING
PLAY, TURN = 21, 4096  # not what a unit goes by: a gear of 1/64, and play that nobody has told it
MOTOR = f"half_steps_per_turn = {TURN}\nbacklash_deg = {PLAY * 360 / TURN}\nstop_deg = 720.0\nhome_arc_deg = 20.0\n"
WALLS = "".join(
    f"[[wall]]\nfrom_m = {list(a)}\nto_m = {list(b)}\n"
    for a, b in [((2.0, -2.0), (2.0, 2.0)), ((2.0, 2.0), (-2.0, 2.0)), ((-2.0, 2.0), (-2.0, -2.0))]
)
ROOM = f'name = "bench"\n[motor]\n{MOTOR}{WALLS}[unit]\nposition_m = [0.0, 0.0]\nheading_deg = 0.0\n'
SITE = """site = "bench"
clock = "unit"

[[unit]]
name = "u1"
serial = 1
address = "socket://127.0.0.1:{port}"
pose = {{ x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }}
sweep = {{ first_bearing_deg = -90, bearing_step_deg = 90, count = 3, start = {start} }}
"""


class Bench:
    """A simulated unit with its gateway, asked as an operator asks it."""

    def __init__(self, running: Programs, endpoint: str) -> None:
        self.running, self.endpoint = running, endpoint

    def noctule(self, command: str, *more: str, ends_with: int = 0) -> str:
        run = subprocess.run(
            ["noctule", command, *more, "--connect", self.endpoint],
            capture_output=True,
            text=True,
            timeout=2 * PATIENCE_S,
        )
        self.running.check()
        assert run.returncode == ends_with, run.stdout + run.stderr
        return run.stdout + run.stderr

    def rpc(self, command: str, *more: str, ends_with: int = 0) -> str:
        return self.noctule("rpc", "bench", "u1", command, *more, ends_with=ends_with)


@contextmanager
def bench_with(tmp_path: Path, faults: str = "", starts: bool = False) -> Iterator[Bench]:
    """The bench, with a unit that suffers these ``faults``."""
    unit_port, bus_port = free_ports(2)
    site, room, scheduled = (tmp_path / f"{name}.toml" for name in ("site", "room", "faults"))
    site.write_text(SITE.format(port=unit_port, start=str(starts).lower()))
    room.write_text(ROOM)
    scheduled.write_text(faults)
    endpoint = f"tcp/127.0.0.1:{bus_port}"
    simulator = ("noctule-sim", "--room", str(room), "--speed", str(SPEED), "--tcp", f"127.0.0.1:{unit_port}")
    simulator += ("--faults", str(scheduled)) if faults else ()
    with programs(tmp_path) as running:
        running.start(
            *("gateway", "noctule-gateway", "run", str(site), "--data", str(tmp_path / "data"), "--listen", endpoint)
        )
        wait_until(lambda: running.check() or listens(bus_port), "no router")
        running.start("simulator", *simulator)
        with Client("bench", connect=[endpoint]) as client:

            def served() -> bool:
                running.check()
                return any(each.state in (IDLE, SWEEPING) for each in client.unit_statuses())

            wait_until(served, "the unit is not served")
        yield Bench(running, endpoint)


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    with bench_with(tmp_path) as bench:
        yield bench


def test_gear_play_and_parts_are_measured_calibrated_and_filed(bench: Bench, tmp_path: Path) -> None:
    told = bench.rpc("measure_gear")
    assert "4096.0 half steps a turn: gear 1/64, and the unit goes by 4075.77" in told
    assert "calibrate --half-steps-per-turn 4096.00" in told
    bench.rpc("calibrate", "--half-steps-per-turn", "4096")
    told = bench.rpc("measure_backlash")
    assert f"calibrate --backlash-half-steps {PLAY}" in told and f"{PLAY} half steps of play" in told
    bench.rpc("calibrate", "--backlash-half-steps", str(PLAY))

    told = bench.rpc("self_test")
    assert told.startswith("u1: nothing found wrong")
    for text in ("V, if the chip's reference", "degrees C, not trimmed", "it opens and closes", "ECHO rises 0.4"):
        assert text in told
    assert "21 half steps of play, as the unit goes by" in told
    assert "without an echo ECHO lasts 38 ms" in told  # no wall behind it from -90 to -180 degrees
    assert "292 degrees up and down" in told

    report = bench.noctule("unit-report", "bench", "u1")
    for text in ("4096.0 half steps a turn: gear 1/64", "it opens and closes", "clock drift"):
        assert text in report
    found = json.loads(bench.noctule("unit-report", "bench", "u1", "--json"))
    names = [each["name"] for each in found["measurements"]]
    assert names[:2] == ["half_steps_per_turn", "backlash_half_steps"] and "no_echo_s" in names

    records = [json.loads(line) for line in (tmp_path / "data" / "audit-1.jsonl").read_text().splitlines()]
    commands = [(each.get("command"), each.get("event")) for each in records]
    assert ("measure_gear", "given") in commands and ("self_test", "done") in commands


def test_what_can_not_be_measured_says_why(bench: Bench) -> None:
    bench.rpc("start")
    assert "busy: stop it" in bench.rpc("self_test", ends_with=1)
    bench.rpc("stop")
    wait_until(lambda: "idle" in bench.rpc("status").splitlines()[0], "it does not stop")
    bench.rpc("calibrate", "--home", "stop")
    assert "a unit without a home switch can't measure this" in bench.rpc("measure_gear", ends_with=1)
    assert "a unit without a home switch can't measure this" in bench.rpc("measure_backlash", ends_with=1)


def test_a_motor_that_loses_steps_is_told_by_the_units_own_check_even_with_three_bearings(tmp_path: Path) -> None:
    faults = "[[fault]]\nat_s = 60.0\nkind = 'motor_loses_steps'\nprobability = 0.002\n"
    with bench_with(tmp_path, faults, starts=True) as bench, Client("bench", connect=[bench.endpoint]) as client:

        def flagged() -> list[Sweep]:
            bench.running.check()
            return [sweep for sweep in client.history("u1") if sweep.faults]

        found = wait_until(flagged, "no sweep is flagged")
        assert list(found[0].faults) == [FAULT_KIND_SLIPPED]
        assert found[0].suspect_before >= 10  # firmware/README.md: a check after ten sweeps, or eleven

        def counted() -> UnitStatus | None:  # a status may be made between the fault and its count
            return next((one for one in client.unit_statuses() if one.faults and one.counters["sweeps_flagged"]), None)

        told = wait_until(counted, "no fault is stated and counted")
        assert told.HasField("slip_rad")
        units = wait_until(lambda: _line_with(bench.noctule("units", "bench"), "slipped"), "units does not tell it")
        assert "its home switch showed" in units


def _line_with(text: str, word: str) -> str | None:
    whole = " ".join(text.split())
    return whole if word in whole else None
