"""The simulator's world as the real firmware meets it: rooms, the air, the motor, and what goes wrong on demand."""

import contextlib
import json
import math
import os
import pty
import re
import subprocess
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from firmware.stepped_unit import IMAGE, SilenceError, SteppedUnit, stepped_unit

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    AskStatus,
    Configure,
    Hello,
    Home,
    NoEcho,
    Single,
    Start,
    State,
    Status,
    Sweep,
)

WALL = """
[[wall]]
from_m = [2.0, -3.0]
to_m = [2.0, 3.0]
"""
UNIT = """
[unit]
position_m = [0.0, 0.0]
"""
# 5 readings straight ahead, 60 ms apart.
STARE = Configure(0, 0, 0, 5, 60, 600, 100, 0, 1)
TICKS_PER_SECOND = 4_000_000
BEARINGS_PER_TURN = 65536
SPEED_OF_SOUND_M_S = 331.3 + 0.606 * 20.0


@pytest.fixture(scope="module", autouse=True)
def image() -> Path:
    made = subprocess.run(["make", "-C", IMAGE.parents[1]], capture_output=True, text=True)
    assert made.returncode == 0, made.stderr
    return IMAGE


def room_of(tmp_path: Path, text: str) -> Path:
    room = tmp_path / "room.toml"
    room.write_text('name = "room"\n' + text)
    return room


@contextmanager
def unit_in(tmp_path: Path, text: str, *options: str) -> Iterator[SteppedUnit]:
    """A unit that has been greeted in a room of its own."""
    with stepped_unit("--room", str(room_of(tmp_path, text)), *options) as unit:
        unit.greet()
        yield unit


def stare(unit: SteppedUnit) -> list[int]:
    """The echoes of one sweep that only looks ahead."""
    unit.command(STARE)
    unit.command(Single(0))
    sweep = unit.receive(Sweep, 60)
    unit.acknowledge(sweep)
    return [reading.echo for reading in sweep.readings]


def range_m(echo: int) -> float:
    return echo / TICKS_PER_SECOND * SPEED_OF_SOUND_M_S / 2


def refusal(*options: str) -> str:
    """What the simulator says when it refuses to run."""
    command = ["noctule-sim", "--firmware", str(IMAGE), "--duration", "0.1", "--tcp", "127.0.0.1:0", *options]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 1, ended.stdout
    return ended.stderr


# Parts that break. The kinds of no echo: firmware/README.md, "Unit to host".


@pytest.mark.parametrize(
    ("kind", "seen"),
    [
        ("sensor_deaf", NoEcho.NO_ECHO),
        ("sensor_short_pulse", NoEcho.TOO_EARLY),
        ("sensor_too_early", NoEcho.TOO_EARLY),
        ("sensor_stuck_high", NoEcho.STUCK_HIGH),
        ("sensor_missing", NoEcho.NO_SENSOR),
    ],
)
def test_what_is_wrong_with_the_sensor_is_in_every_reading_until_it_is_mended(tmp_path, kind, seen):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": kind})
        assert stare(unit) == [seen] * 5
        unit.step(fault={"kind": "mended"})
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([2.0] * 5, abs=1e-3)


@pytest.mark.parametrize("kind", ["motor_stuck", "home_stuck_open"])
def test_a_unit_that_cannot_home_says_so(tmp_path, kind):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": kind})
        unit.command(Home(0))
        assert unit.wait_for_state(State.FAULT).fault == 1


def test_a_held_button_is_a_press_and_the_truth_knows_of_it(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.step(fault={"kind": "button_held", "for_s": 0.2})
        assert unit.truth["button_pressed"] and unit.truth["led_lit"]
        unit.receive(Sweep, 60)
        assert not unit.truth["button_pressed"]


def test_nothing_is_lost_over_a_cable_that_was_pulled(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.command(Single(0))
        unit.step(fault={"kind": "cable_pulled", "for_s": 30})
        with pytest.raises(SilenceError):
            unit.receive(Sweep, 29)
        assert unit.receive(Sweep, 10).sequence == 0


def test_how_a_run_is_stepped_through_changes_nothing_of_what_a_cable_passes(tmp_path):
    def sent(steps: int, *options: str) -> tuple[float, list[bytes]]:
        """When the unit was told to home, and what it has sent within a second of that, by steps."""
        with unit_in(tmp_path, WALL + UNIT, *options) as unit:
            told_s = unit.now_s
            unit.send(Home(9))
            return told_s, [unit.run(1.0 / steps) for _ in range(steps)]

    told_s, parts = sent(2000)
    answered_s = next(step for step, part in enumerate(parts) if part) / 2000
    # The answer and a STATUS are on the line for 4 ms; the cable is plugged in again after the first bytes.
    faults = tmp_path / "faults.toml"
    faults.write_text(f'[[fault]]\nat_s = {told_s}\nkind = "cable_pulled"\nfor_s = {answered_s + 0.0007}\n')
    at_once, in_steps = (b"".join(sent(steps, "--faults", str(faults))[1]) for steps in (1, 1777))
    assert at_once == in_steps
    assert 0 < len(at_once) < len(b"".join(parts))


def test_a_cable_that_garbles_bytes_makes_bad_frames_and_loses_no_sweep(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.command(Start(0, 0))
        unit.step(fault={"kind": "cable_corrupts", "to_unit": 0.02, "to_host": 0.002, "for_s": 60})
        sequences = set()
        while unit.now_s < 70:
            sweep = unit.receive(Sweep, 20)
            unit.acknowledge(sweep)
            sequences.add(sweep.sequence)
        unit.step(fault={"kind": "mended"})
        assert unit.ask(AskStatus(0), Status).frames_bad > 0
        assert sequences == set(range(len(sequences)))


def test_a_power_cut_is_followed_by_a_power_up(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        began = unit.step(fault={"kind": "power_cut", "for_s": 2.0})
        assert began == b""
        cut_at_s = unit.now_s
        hello = unit.receive(Hello, 10)
        assert hello.request == 0
        assert unit.now_s >= cut_at_s + 2.0
        assert unit.truth["resets"] == 1


def test_a_dip_of_the_supply_resets_the_chip_by_its_monitor(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": "brown_out"})
        # RSTSRC.PORSF (C8051F34x data sheet, SFR definition of RSTSRC)
        assert unit.receive(Hello, 10).reset_cause & 0x02


def test_the_power_may_go_in_the_midst_of_a_flash_operation(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 0\nkind = "power_cut_at_flash_operation"\nnumber = 1\n')
    with unit_in(tmp_path, WALL + UNIT, "--faults", str(faults)) as unit:
        # The first boot's was its boot number; it ended there, and the second one went on.
        assert unit.truth["resets"] == 1
        assert unit.truth["flash_operations"] >= 2


def test_faults_of_a_schedule_come_and_go_at_their_times(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 3\nunit = 1\nkind = "button_held"\nfor_s = 0.5\n')
    with unit_in(tmp_path, WALL + UNIT, "--faults", str(faults)) as unit:
        pressed = []
        while unit.now_s < 4.0:
            unit.run(0.1)
            pressed.append((round(unit.now_s, 3), unit.truth["button_pressed"]))
    held = [at_s for at_s, is_pressed in pressed if is_pressed]
    assert 3.0 < held[0] < 3.11 and 3.39 < held[-1] <= 3.5


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ('kind = "gremlin"', "gremlin"),
        ('kind = "motor_stuck"\ncolour = "red"', "colour"),
        ('kind = "motor_stuck"\nunit = 2', "unit is none of the units"),
        ('kind = "power_cut"', "for_s"),
        ('kind = "motor_loses_steps"\nprobability = 2', "probability"),
        ('kind = "brown_out"\nfor_s = 2', "for_s"),
    ],
)
def test_a_fault_that_makes_no_sense_is_refused_by_file_and_field(tmp_path, fault, words):
    faults = tmp_path / "faults.toml"
    faults.write_text(f"[[fault]]\nat_s = 1\n{fault}\n")
    told = refusal("--faults", str(faults))
    assert "faults.toml" in told and words in told


# The motor.


def test_the_truth_of_the_bearing_is_what_the_unit_says_but_for_half_a_step(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(Home(0))
        unit.wait_for_state(State.IDLE)
        said_rad = unit.ask(AskStatus(0), Status).bearing / BEARINGS_PER_TURN * math.tau
        assert unit.truth["bearing_rad"] == pytest.approx(said_rad, abs=1.5 * math.tau / 4075.77)
        assert not unit.truth["coils_on"]


def test_slack_leaves_the_sensor_behind_by_as_much(tmp_path):
    def turned_deg(backlash_deg: float) -> float:
        """How far the sensor turns when the motor goes to and fro."""
        motor = f"[motor]\nbacklash_deg = {backlash_deg}\n"
        with unit_in(tmp_path, WALL + motor + UNIT, "--seed", "3") as unit:
            unit.command(Home(0))
            unit.wait_for_state(State.IDLE)
            bearings = []
            for bearing in (-16384, 0, -8192):
                unit.command(Configure(0, bearing, 0, 1, 60, 600, 100, 0, 1))
                unit.command(Single(0))
                unit.acknowledge(unit.receive(Sweep, 60))
                bearings.append(unit.truth["bearing_rad"])
            return math.degrees(bearings[1] - bearings[2])

    assert turned_deg(0.0) == pytest.approx(45.0, abs=0.1)
    assert turned_deg(2.0) == pytest.approx(43.0, abs=0.1)


# The room and its air.


def test_an_object_that_moves_is_measured_where_it_is(tmp_path):
    moving = "[[cylinder]]\nradius_m = 0.3\npath = ["
    moving += "{ at_s = 20, center_m = [1.3, 0.0] }, { at_s = 25, center_m = [1.8, 0.0] }]\n"
    with unit_in(tmp_path, moving + UNIT) as unit:
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([1.0] * 5, abs=1e-3)
        unit.run(26 - unit.now_s)
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([1.5] * 5, abs=1e-3)


def test_warming_air_shortens_the_flight(tmp_path):
    air = "air_temperature_schedule = [{ at_s = 30, temperature_c = 0 }, { at_s = 40, temperature_c = 30 }]\n"
    with unit_in(tmp_path, air + WALL + UNIT) as unit:
        cold = stare(unit)
        assert unit.truth["air_temperature_c"] == 0.0
        unit.run(41 - unit.now_s)
        warm = stare(unit)
        assert unit.truth["air_temperature_c"] == 30.0
    assert cold[0] / warm[0] == pytest.approx((331.3 + 0.606 * 30) / 331.3, abs=1e-4)


def test_pings_faster_than_the_room_goes_quiet_hear_the_last_one(tmp_path):
    lobe = "[sensor]\nlobe = [{ range_m = 0.0, half_angle_deg = 11.25 }]\n"
    wall = "[[wall]]\nfrom_m = [2.6, -3.0]\nto_m = [2.6, 3.0]\n"

    def sweep(reverberation_ms: float) -> Sweep:
        with unit_in(tmp_path, f"{lobe}reverberation_ms = {reverberation_ms}\n{wall}{UNIT}") as unit:
            unit.command(Configure(0, 0, 0, 64, 29, 600, 100, 0, 1))
            unit.command(Single(0))
            return unit.receive(Sweep, 60)

    assert all(range_m(reading.echo) == pytest.approx(2.6, abs=1e-3) for reading in sweep(29.0).readings)
    early = 0
    for before, reading in pairwise(sweep(40.0).readings):
        # To the wall and back twice, less the time from ping to ping; an offset is in 4 us.
        interval_s = (reading.offset - before.offset) * 4e-6
        late_m = 2 * 2.6 - interval_s * SPEED_OF_SOUND_M_S / 2
        early += range_m(reading.echo) == pytest.approx(late_m, abs=2e-3)
        assert range_m(reading.echo) in (pytest.approx(2.6, abs=1e-3), pytest.approx(late_m, abs=2e-3))
    # Every other time of 63.
    assert 16 < early < 47


# Several units in one room.

FACING = """
[[wall]]
from_m = [-0.5, -3.0]
to_m = [-0.5, 3.0]
[[wall]]
from_m = [3.0, -3.0]
to_m = [3.0, 3.0]
[[unit]]
position_m = [0.0, 0.0]
[[unit]]
position_m = [1.5, 0.0]
heading_deg = 180.0
"""


class Room:
    """Units that share a room, run in step."""

    def __init__(self, room: Path, *options: str):
        command = ["noctule-sim", "--control", "--firmware", str(IMAGE), "--room", str(room), *options]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def step(self, **request: Any) -> dict[str, Any]:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(json.dumps(request) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def close(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.close()
        assert self.process.wait(10) == 0
        self.process.stdout.close()


def sweeps_of_both(room: Path, steps: int, units: int = 2) -> list[list[int]]:
    """The echoes of each unit that stares ahead for a while, run in so many steps."""
    fleet = Room(room, "--units", str(units))
    try:
        fleet.step(until_s=2.0)
        # Not at the same pace, or they would miss each other every time or never.
        plans = [Configure(1, 0, 0, 64, interval_ms, 600, 100, 0, 1) for interval_ms in (40, 44)]
        fleet.step(feed=[(encode(plan) + encode(Home(2))).hex() for plan in plans[:units]])
        fleet.step(until_s=20.0)
        fleet.step(feed=[encode(Single(3)).hex()] * units)
        heard = [bytearray() for _ in range(units)]
        for step in range(1, steps + 1):
            answer = fleet.step(until_s=20.0 + 6.0 * step / steps)
            for line, sent in zip(heard, answer["sent"], strict=True):
                line += bytes.fromhex(sent)
    finally:
        fleet.close()
    echoes = []
    for line in heard:
        sweeps = [frame for frame in FrameReader().feed(bytes(line)) if isinstance(frame, Sweep)]
        echoes.append([reading.echo for reading in sweeps[0].readings])
    return echoes


def test_units_that_face_each_other_hear_each_other(tmp_path):
    room = room_of(tmp_path, FACING)
    alone = sweeps_of_both(room, 1, units=1)[0]
    assert [range_m(echo) for echo in alone] == pytest.approx([3.0] * 64, abs=1e-3)
    first, second = sweeps_of_both(room, 1)
    # At 1.5 m from one another they hear a burst at any time up to their own echo.
    assert 10 < sum(range_m(echo) < 2.99 for echo in first) < 60
    assert 5 < sum(range_m(echo) < 1.99 for echo in second) < 60


def test_how_a_shared_room_is_stepped_through_changes_nothing(tmp_path):
    room = room_of(tmp_path, FACING)
    assert sweeps_of_both(room, 1) == sweeps_of_both(room, 977)


def test_more_units_than_the_room_has_places_for_are_refused(tmp_path):
    told = refusal("--room", str(room_of(tmp_path, FACING)), "--units", "3")
    assert "places for 2 units" in told


# What the operator sees.


def test_a_run_begins_with_what_runs(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 1\nkind = "motor_stuck"\n')
    command = ["noctule-sim", "--firmware", str(IMAGE), "--tcp", "127.0.0.1:0", "--seed", "5", "--speed", "max"]
    ended = subprocess.run(
        [*command, "--duration", "0.1", "--faults", str(faults)], capture_output=True, text=True, check=True
    )
    image = b"".join(bytes.fromhex(line[9:-2]) for line in IMAGE.read_text().split() if line[7:9] == "00")
    assert re.search(r"unit 1: socket://127\.0\.0\.1:\d+, ", ended.stdout)
    assert f"{len(image)} bytes, CRC-32 {zlib.crc32(image):08X}" in ended.stdout
    assert "room paper: 5 walls, 1 cylinder, air at 21.0 degrees C" in ended.stdout
    assert "seed 5, as fast as it can for 0.1 s, 1 fault" in ended.stdout
    assert ended.stderr == ""


def test_a_room_is_drawn_without_a_firmware(tmp_path):
    drawing = tmp_path / "room.svg"
    room = room_of(tmp_path, FACING.replace("to_m = [3.0, 3.0]", "to_m = [3.0, 3.0]\nabsorption = 0.7"))
    subprocess.run(["noctule-sim", "--room", room, "--svg", drawing], check=True, cwd=tmp_path)
    words = " ".join(ElementTree.parse(drawing).getroot().itertext())
    assert all(word in words for word in ("room", "unit 1", "unit 2", "absorber", "70 %", "1 m"))


def read_to_the_end(terminal: int) -> bytes:
    """All that was written to a terminal whose other end is closed: it comes in pieces, and then an error."""
    told = b""
    with contextlib.suppress(OSError):
        while piece := os.read(terminal, 65536):
            told += piece
    return told


def test_a_shell_completes_the_command_line():
    typed = "noctule-sim --fi"
    script = f"""
source <(noctule-sim --completion bash)
COMP_WORDS=({typed}) COMP_CWORD=1 COMP_LINE='{typed}'
_noctule__sim {typed} noctule-sim
echo "${{COMPREPLY[*]}}"
"""
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["--firmware"]


@pytest.mark.parametrize("option", [["--completion", "bash"], ["--registers"]], ids=lambda option: option[0])
def test_what_is_printed_to_a_full_disk_ends_without_a_panic(option):
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(["noctule-sim", *option], stdout=full, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_terminal_is_told_how_far_the_run_has_got():
    leader, follower = pty.openpty()
    command = ["noctule-sim", "--firmware", str(IMAGE), "--tcp", "127.0.0.1:0", "--duration", "1.5"]
    try:
        subprocess.run(command, stdout=subprocess.PIPE, stderr=follower, check=True, timeout=120)
        os.close(follower)
        told = read_to_the_end(leader).decode()
    finally:
        os.close(leader)
    assert re.search(r"\r\x1b\[K\d\.\d s simulated, \d\.\d times real time, \d+ frames", told)
    assert told.endswith("\r\x1b[K")


def test_a_room_with_places_for_two_has_two_units_unless_told_otherwise():
    command = ["noctule-sim", "--firmware", str(IMAGE), "--room", "lounge", "--tcp", "127.0.0.1:0", "--duration", "0.1"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert re.findall(r"unit (\d): socket:.*sharing the room", told) == ["1", "2"]
    told = subprocess.run([*command, "--units", "1"], capture_output=True, text=True, check=True).stdout
    assert re.findall(r"unit (\d): socket:", told) == ["1"]
