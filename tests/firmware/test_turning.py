"""Where the sensor truly looks: sweeps, homing and GO_TO by the real firmware in noctule-sim."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from random import Random

import pytest
from firmware.flood import flood
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    AskClock,
    AskStatus,
    Calibrate,
    Clock,
    Configure,
    GoTo,
    Hello,
    Home,
    Single,
    Start,
    Status,
    Stop,
    Sweep,
)

# firmware/README.md: states, results, faults, flags
IDLE, SWEEPING, HOMING, FAULT, PAUSING, TURNING = 0, 1, 2, 4, 5, 6
DONE, BUSY, OUT_OF_RANGE, NOT_HOMED = range(4)
NO_SWITCH, SWITCH_STAYS_CLOSED = 1, 2
DECREASING = 0x01
TICKS_PER_S = 4_000_000
TICKS_PER_OFFSET = 16
NO_ECHO_S = 38e-3  # firmware/simulator/README.md
ECHO_LAG_S = 450e-6

HALF_STEPS_PER_TURN = 25792 / 405 * 64
HALF_STEP_DEG = 360 / HALF_STEPS_PER_TURN
# The switch closes somewhere between two half steps, and a wanted bearing is rounded to half of one.
HOMED_DEG = 1.5 * HALF_STEP_DEG
DEFAULT_TURN = round(HALF_STEPS_PER_TURN * 256)
DEFAULT_HOME = -27307
DEFAULT_PLAN = Configure(0, -24576, 4096, 13, 60, 600, 100, 20, 1)
CLOCK_FRAME_S = 20 * 10 / 115_385
SAMPLE_S = 0.005

Place = Callable[[str], SteppedUnit]


@pytest.fixture
def placed(tmp_path: Path, firmware: Path) -> Iterator[Place]:
    """A function that gives a unit with this [motor] in a box of 4 m by 4 m, which has said hello."""
    corners = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]
    walls = zip(corners, corners[1:] + corners[:1], strict=True)
    box = "".join(f"[[wall]]\nfrom_m = {list(a)}\nto_m = {list(b)}\n" for a, b in walls)
    with ExitStack() as stack:

        def place(motor: str = "", *options: str) -> SteppedUnit:
            room = tmp_path / "room.toml"
            stand = "[unit]\nposition_m = [0.0, 0.0]\nheading_deg = 0.0\n"
            room.write_text(f'name = "box"\n[motor]\n{motor}\n{box}{stand}')
            unit = stack.enter_context(stepped_unit("--room", str(room), *options, image=firmware))
            unit.greet()
            return unit

        yield place


def degrees(bearing: int) -> float:
    return bearing * 360 / 65536


def bearing(degrees: float) -> int:
    return round(degrees * 65536 / 360)


def looks_at_deg(unit: SteppedUnit) -> float:
    return math.degrees(unit.truth["bearing_rad"])


def home(unit: SteppedUnit) -> Status:
    assert unit.command(Home(0)) == DONE
    unit.wait_for_state(HOMING)
    while (status := unit.receive(Status, within_s=60)).state == HOMING:
        pass
    return status


def go_to(unit: SteppedUnit, degrees: float) -> float:
    """Turn there; where the sensor then truly looks, in degrees."""
    assert unit.command(GoTo(0, bearing(degrees))) == DONE
    unit.wait_for_state(IDLE)
    return looks_at_deg(unit)


def calibrate(
    unit: SteppedUnit, turn: float = HALF_STEPS_PER_TURN, backlash: int = 0, kind: int = 0, home_deg: float = -150.0
) -> None:
    assert unit.command(Calibrate(0, round(turn * 256), backlash, kind, bearing(home_deg))) == DONE


def clock_began_s(unit: SteppedUnit) -> float:
    """When the unit's tick was 0: after power-up its loader runs first."""
    sent = unit.ask(AskClock(0), Clock).sent
    return unit.now_s - CLOCK_FRAME_S - sent / TICKS_PER_S


def watch_sweep(unit: SteppedUnit) -> tuple[Sweep, list[float]]:
    """One sweep, and where the sensor truly looked at each of its readings, in degrees."""
    sampled = []
    began_s = clock_began_s(unit)
    assert unit.command(Single(0)) == DONE
    while not (swept := unit.take(Sweep)):
        unit.run(SAMPLE_S)
        sampled.append((unit.now_s, looks_at_deg(unit)))
    (made,) = swept
    unit.acknowledge(made)
    looked = []
    for reading in made.readings:
        trigger_s = began_s + (made.start + reading.offset * TICKS_PER_OFFSET) / TICKS_PER_S
        looked.append(min(sampled, key=lambda sample: abs(sample[0] - trigger_s))[1])
    return made, looked


def ideal_move_s(half_steps: int, top_speed: float, ramp_s: float) -> float:
    """From rest to rest: v^2 = 2 a n at the n-th half step from either end, up to the top speed."""

    def interval_s(level: int) -> float:
        return max(math.sqrt(ramp_s / (2 * top_speed * level)), 1 / top_speed)

    return sum(interval_s(min(step, half_steps + 1 - step)) for step in range(1, half_steps + 1))


def test_a_sweep_takes_no_more_than_its_ramps_settling_and_pings(placed):
    unit = placed()
    assert unit.command(DEFAULT_PLAN) == DONE
    assert unit.command(Start(0, 0)) == DONE
    sweeps = []
    while len(sweeps) < 5:
        sweeps.append(unit.receive(Sweep, within_s=60))
        unit.acknowledge(sweeps[-1])
    for made, following in pairwise(sweeps):
        bearings = [reading.bearing for reading in made.readings]
        half_steps = [round(value * HALF_STEPS_PER_TURN / 65536) for value in bearings]
        moves_s = sum(ideal_move_s(abs(b - a), 600, 0.1) for a, b in pairwise(half_steps))
        echoes = (reading.echo / TICKS_PER_S for reading in made.readings)
        pings_s = sum(min(echo, NO_ECHO_S) + ECHO_LAG_S for echo in echoes)
        taken_s = (following.start - made.start) / TICKS_PER_S
        ideal_s = moves_s + 13 * 0.02 + pings_s
        assert 0.95 * ideal_s < taken_s <= 1.05 * ideal_s


def test_a_switch_tells_where_the_sensor_looks(placed):
    unit = placed()
    status = home(unit)
    assert (status.state, status.homed, status.fault) == (IDLE, True, 0)
    assert degrees(status.bearing) == pytest.approx(looks_at_deg(unit), abs=HOMED_DEG)
    assert go_to(unit, 0.0) == pytest.approx(0.0, abs=HOMED_DEG)


@pytest.mark.parametrize("motor_turn", [3870.4, 4075.7728, 4312.7])
@pytest.mark.parametrize("backlash", [0, 9, 40])
def test_bearings_are_the_sensors_by_its_own_gears(placed, motor_turn, backlash):
    unit = placed(f"half_steps_per_turn = {motor_turn}\nbacklash_deg = {backlash * 360 / motor_turn}")
    calibrate(unit, motor_turn, backlash)
    home(unit)
    assert unit.command(DEFAULT_PLAN) == DONE
    directions = set()
    for _ in range(4):
        made, looked = watch_sweep(unit)
        directions.add(made.flags & DECREASING)
        for reading, truth in zip(made.readings, looked, strict=True):
            assert degrees(reading.bearing) == pytest.approx(truth, abs=360 / motor_turn)
    assert directions == {0, DECREASING}


def test_backlash_that_is_not_calibrated_shows(placed):
    unit = placed(f"backlash_deg = {40 * HALF_STEP_DEG}")
    home(unit)
    errors = [abs(go_to(unit, there) - there) for there in (-50.0, 50.0, 0.0)]
    assert max(errors) > 39 * HALF_STEP_DEG


def test_bearings_do_not_drift(placed):
    unit = placed(f"backlash_deg = {9 * HALF_STEP_DEG}")
    calibrate(unit, backlash=9)
    home(unit)
    before = [go_to(unit, there) for there in (30.0, -30.0)]
    assert unit.command(Configure(0, bearing(-140), bearing(31.3), 9, 29, 800, 50, 0, 1)) == DONE
    assert unit.command(Start(0, 0)) == DONE
    for _ in range(100):
        unit.acknowledge(unit.receive(Sweep, within_s=30))
    assert unit.command(Stop(0)) == DONE
    unit.wait_for_state(IDLE)
    assert [go_to(unit, there) for there in (30.0, -30.0)] == pytest.approx(before, abs=1e-9)


def test_no_load_on_the_line_loses_or_delays_a_half_step(placed):
    unit = placed()
    home(unit)
    before = [go_to(unit, there) for there in (30.0, -30.0)]
    # the fastest that a unit takes; the simulator's motor loses half steps that follow at over 1050 a second
    assert unit.command(Configure(0, bearing(-140), bearing(35), 9, 29, 800, 100, 20, 1)) == DONE
    assert unit.command(Start(0, 0)) == DONE
    quiet = unit.receive(Sweep, within_s=60)
    flooded = flood(unit, 30.0, Random(2))
    assert len(flooded) > 5
    for made in flooded:
        # each of eight moves may be found to be over by a round of 2 ms earlier or later
        assert abs(made.readings[-1].offset - quiet.readings[-1].offset) * TICKS_PER_OFFSET <= 8 * 0.002 * TICKS_PER_S
    unit.run(1.0)
    assert unit.command(Stop(0)) == DONE
    unit.wait_for_state(IDLE)
    assert [go_to(unit, there) for there in (30.0, -30.0)] == pytest.approx(before, abs=1e-9)


@pytest.mark.parametrize("backlash", [0, 9])
def test_an_end_stop_is_found_again_where_it_was(placed, backlash):
    unit = placed(f'home = "none"\nstop_deg = 160.0\nbacklash_deg = {backlash * HALF_STEP_DEG}')
    calibrate(unit, backlash=backlash, kind=1, home_deg=-160.0)
    home(unit)
    # As a person calibrates it: send it forward, see by how much it misses, and say so.
    missed = go_to(unit, 0.0)
    assert abs(missed) <= 6 * HALF_STEP_DEG
    calibrate(unit, backlash=backlash, kind=1, home_deg=-160.0 + missed)
    for start in (0.0, 140.0, -147.9, 77.7):
        home(unit)
        assert go_to(unit, 0.0) == pytest.approx(0.0, abs=HOMED_DEG)
        go_to(unit, start)


def test_an_end_stop_is_found_again_after_a_power_cut(placed):
    unit = placed('home = "none"\nstop_deg = 160.0')
    looked = []
    for turned_to in (-40.0, 55.5, 3.3):
        calibrate(unit, kind=1, home_deg=-160.0)
        home(unit)
        looked.append(go_to(unit, 0.0))
        go_to(unit, turned_to)
        unit.inject("power_cut", for_s=1.0)
        unit.receive(Hello)
    assert looked == pytest.approx([looked[0]] * 3, abs=1e-9)


def test_a_switch_elsewhere_is_taken_at_its_calibrated_bearing(placed):
    unit = placed()
    calibrate(unit, home_deg=-155.0)  # it is at -150
    home(unit)
    assert go_to(unit, 0.0) == pytest.approx(5.0, abs=HOMED_DEG)


def test_a_switch_straight_behind_is_at_the_half_step_below_it(placed):
    # -180 degrees are 2037.885 half steps down: 2038 are past them, and are +179.99 degrees as a bearing.
    unit = placed()
    looked = []
    for home_bearing in (-32761, -32768):  # 2037.45 half steps down, and 2037.885
        assert unit.command(Calibrate(0, DEFAULT_TURN, 0, 0, home_bearing)) == DONE
        home(unit)
        looked.append(go_to(unit, 0.0))
    assert looked[0] == pytest.approx(looked[1], abs=HALF_STEP_DEG / 4)


@pytest.mark.parametrize(
    ("broken", "fault"), [("home_stuck_open", NO_SWITCH), ("home_stuck_closed", SWITCH_STAYS_CLOSED)]
)
def test_a_broken_switch_is_told_and_stops_nothing_else(placed, broken, fault):
    unit = placed()
    unit.inject(broken)
    assert unit.command(Single(0)) == DONE
    for _ in range(5):
        unit.ask(AskStatus(0), Status, within_s=0.1)
    status = unit.wait_for_state(FAULT)
    assert (status.fault, status.homed) == (fault, False)
    assert unit.command(GoTo(0, 0)) == NOT_HOMED
    assert not unit.truth["coils_on"]
    assert unit.truth["resets"] == 0
    unit.inject("mended")
    assert unit.command(Single(0)) == DONE
    assert unit.receive(Sweep, within_s=60)
    assert unit.ask(AskStatus(0), Status).fault == 0


def test_a_stuck_motor_does_not_stop_the_link(placed):
    unit = placed()
    home(unit)
    unit.inject("motor_stuck")
    assert unit.command(Start(0, 0)) == DONE
    for _ in range(3):
        unit.ask(AskStatus(0), Status, within_s=0.1)
        unit.acknowledge(unit.receive(Sweep, within_s=60))
    assert unit.command(Stop(0)) == DONE
    unit.wait_for_state(IDLE)
    assert unit.truth["resets"] == 0
    unit.inject("mended")
    home(unit)
    assert go_to(unit, 20.0) == pytest.approx(20.0, abs=HOMED_DEG)


def test_the_coils_are_off_whenever_the_unit_rests(placed):
    unit = placed()
    home(unit)
    assert not unit.truth["coils_on"]
    assert unit.command(Start(0, 500)) == DONE
    unit.wait_for_state(PAUSING)
    unit.run(0.1)
    assert not unit.truth["coils_on"]
    unit.wait_for_state(SWEEPING)
    unit.run(0.1)
    assert unit.truth["coils_on"]
    assert unit.command(Stop(0)) == DONE
    unit.wait_for_state(IDLE)
    assert not unit.truth["coils_on"]


def test_go_to_is_done_only_by_a_homed_unit_at_rest_and_within_148_degrees(placed):
    unit = placed()
    assert unit.command(GoTo(0, 0)) == NOT_HOMED
    assert unit.command(Home(0)) == DONE
    assert unit.command(GoTo(0, 0)) == BUSY
    unit.wait_for_state(IDLE)
    for outside in (bearing(148.1), bearing(-148.1), -32768, 32767):
        assert unit.command(GoTo(0, outside)) == OUT_OF_RANGE
    for there in (147.9, -147.9, 12.3):
        assert go_to(unit, there) == pytest.approx(there, abs=HOMED_DEG)
        assert degrees(unit.ask(AskStatus(0), Status).bearing) == pytest.approx(there, abs=HOMED_DEG)


def test_stop_ends_a_turn_and_the_bearing_stays_known(placed):
    unit = placed()
    home(unit)
    assert unit.command(GoTo(0, bearing(140.0))) == DONE
    assert unit.wait_for_state(TURNING)
    assert unit.command(GoTo(0, 0)) == BUSY
    unit.run(1.0)
    assert unit.command(Stop(0)) == DONE
    status = unit.wait_for_state(IDLE)
    assert -150 < degrees(status.bearing) < 0
    assert degrees(status.bearing) == pytest.approx(looks_at_deg(unit), abs=HOMED_DEG)


def test_a_calibration_is_taken_at_rest_only_and_makes_the_unit_home_again(placed):
    unit = placed()
    home(unit)
    assert unit.command(Calibrate(0, DEFAULT_TURN, 129, 0, DEFAULT_HOME)) == OUT_OF_RANGE
    assert unit.ask(AskStatus(0), Status).homed
    assert unit.command(GoTo(0, 0)) == DONE
    assert unit.command(Calibrate(0, DEFAULT_TURN, 0, 0, DEFAULT_HOME)) == BUSY
    unit.wait_for_state(IDLE)
    assert unit.command(Calibrate(0, DEFAULT_TURN, 0, 0, DEFAULT_HOME)) == DONE
    assert not unit.ask(AskStatus(0), Status).homed
    assert unit.command(GoTo(0, 0)) == NOT_HOMED


def test_a_unit_that_is_calibrated_between_two_sweeps_homes_before_the_next(placed):
    unit = placed()
    assert unit.command(Start(0, 500)) == DONE
    unit.wait_for_state(PAUSING)
    calibrate(unit, backlash=3)
    assert unit.wait_for_state(HOMING).started
    assert unit.wait_for_state(SWEEPING).homed


@pytest.mark.parametrize("top_speed", [50, 55, 60, 61, 62, 100])
def test_a_slow_plan_turns_at_its_speed(placed, top_speed):
    unit = placed()
    assert unit.command(Configure(0, 0, 0, 1, 60, top_speed, 0, 0, 1)) == DONE
    assert unit.command(Home(0)) == DONE
    unit.wait_for_state(IDLE)
    assert unit.command(GoTo(0, 0)) == DONE
    unit.run(1.0)
    began_rad = unit.truth["bearing_rad"]
    unit.run(4.0)
    half_steps = (unit.truth["bearing_rad"] - began_rad) / math.tau * HALF_STEPS_PER_TURN
    assert half_steps == pytest.approx(4.0 * top_speed, abs=2)
