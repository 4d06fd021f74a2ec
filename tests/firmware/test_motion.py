"""Where the motor goes and how fast: bearings, the gears' play, ramps, and what plans and calibrations are possible."""

import math
import statistics

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

# The 28BYJ-48's gears, counted by many hands: 32/9 * 22/11 * 26/9 * 31/10, and 64 half steps for a turn of the rotor.
HALF_STEPS_PER_TURN = 32 / 9 * 22 / 11 * 26 / 9 * 31 / 10 * 64
DEFAULT_TURN = round(HALF_STEPS_PER_TURN * 256)

bearings = st.integers(-32768, 32767)
half_steps = st.integers(-1899, 1899)  # less than half of any turn
turns = st.integers(3800 * 256, 4400 * 256)  # firmware/README.md, CALIBRATE


def test_a_turn_has_4075_77_half_steps():
    # firmware/README.md: 4075.77 half steps per revolution
    assert pytest.approx(4075.77, abs=0.005) == HALF_STEPS_PER_TURN


@given(turns, bearings)
def test_a_bearing_goes_to_the_nearest_half_step(pure_modules, turn, bearing):
    exact = bearing * turn / 256 / 65536
    assert abs(int(pure_modules.ask("half_step", turn, bearing)) - exact) <= 0.5


@given(turns, half_steps)
def test_a_half_step_has_the_nearest_bearing(pure_modules, turn, half_step):
    exact = half_step * 65536 / (turn / 256)
    assert abs(int(pure_modules.ask("bearing", turn, half_step)) - exact) <= 0.5 + 1e-9


@given(turns, half_steps)
def test_going_where_one_is_moves_nothing(pure_modules, turn, half_step):
    bearing = pure_modules.ask("bearing", turn, half_step)
    assert int(pure_modules.ask("half_step", turn, bearing)) == half_step


class Gears:
    """Gears with a play: the sensor is dragged along once the motor has crossed it. Begins after a fall."""

    def __init__(self, play: int, sensor: int):
        self.play, self.motor, self.sensor = play, sensor - play, sensor

    def turn_to(self, motor: int) -> None:
        while self.motor != motor:
            self.motor += 1 if motor > self.motor else -1
            self.sensor = min(max(self.sensor, self.motor), self.motor + self.play)


@given(st.integers(0, 64), half_steps, st.lists(half_steps, min_size=1, max_size=20))
def test_the_play_is_taken_up_whatever_the_moves(pure_modules, play, start, wanted):
    gears = Gears(play, start)
    *motor, sensor = map(int, pure_modules.ask("backlash", play, start, *wanted).split())
    for goes_to, looks_at in zip(motor, wanted, strict=True):
        gears.turn_to(goes_to)
        assert gears.sensor == looks_at
    assert sensor == wanted[-1]


def test_a_move_on_in_the_same_direction_takes_up_no_play(pure_modules):
    # down to 0 with a play of 9 the motor is at -9; up it stands where the sensor looks
    assert pure_modules.ask("backlash", 9, 0, -100, -200, -200, 50, 60, 40) == "-109 -209 -209 50 60 31 40"


@given(st.lists(st.integers(0, 0xFFFFFF), min_size=5, max_size=5), st.sampled_from([1, 3, 5]))
def test_a_reading_is_the_median_of_its_pings(pure_modules, values, pings):
    assert int(pure_modules.ask("median", *values[:pings])) == statistics.median(values[:pings])


@given(st.integers(50, 1000), st.integers(0, 1000))
def test_intervals_are_those_of_constant_acceleration(pure_modules, top_speed, ramp_ms):
    *ramp, cruise = map(int, pure_modules.ask("ramp", top_speed, ramp_ms, 512).split())
    assert cruise == 1_000_000 // top_speed
    for level, interval_us in enumerate(ramp, start=1):
        # v^2 = 2 a n with a = top speed / ramp time
        speed = math.sqrt(2 * top_speed / (ramp_ms / 1000) * level) if ramp_ms else math.inf
        expected = min(max(1e6 / speed, cruise), 20_000)
        # firmware/src/core/ramp.c: within 0.8 % past level 128; truncations make up to 5 us everywhere
        tolerance_us = 5 + (0.008 * expected if level > 128 else 0)
        assert interval_us == pytest.approx(expected, abs=tolerance_us)


@given(st.integers(50, 1000), st.integers(0, 1000))
def test_no_half_step_of_a_ramp_up_is_slower_than_the_one_before(pure_modules, top_speed, ramp_ms):
    intervals = [int(interval) for interval in pure_modules.ask("ramp", top_speed, ramp_ms, 512).split()]
    assert intervals == sorted(intervals, reverse=True)


@given(st.integers(50, 1000), st.integers(0, 1000))
def test_no_interval_is_longer_than_the_timer_can_run(pure_modules, top_speed, ramp_ms):
    # timer 3 counts 4 MHz and runs twice for a half step: 2 * 65536 counts
    intervals = map(int, pure_modules.ask("ramp", top_speed, ramp_ms, 10).split())
    assert max(intervals) * 4 < 2 * 65536


def plan(**changes: int) -> list[int]:
    fields = {
        "first": -24576,
        "step": 4096,
        "count": 13,
        "interval": 60,
        "speed": 600,
        "ramp": 100,
        "settle": 20,
        "pings": 1,
    }
    return list((fields | changes).values())


@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"interval": 29},
        {"interval": 1000},
        {"speed": 50},
        {"speed": 800},
        {"speed": 500, "ramp": 0, "settle": 0},
        {"speed": 501, "ramp": 50},
        {"ramp": 1000, "settle": 1000},
        {"count": 64, "step": 0},
        {"first": round(-148 * 65536 / 360) + 1, "count": 1},
        {"first": 26942, "count": 1, "step": 65535},
    ],
)
def test_a_plan_at_the_limits_of_the_table_is_possible(pure_modules, changes):
    assert pure_modules.ask("plan", *plan(**changes)) == "1"


@pytest.mark.parametrize(
    "changes",
    [
        {"count": 0},
        {"count": 65, "step": 0},
        {"interval": 28},
        {"interval": 1001},
        {"speed": 49},
        {"speed": 801},
        {"ramp": 1001},
        {"speed": 501, "ramp": 49},
        {"settle": 1001},
        {"first": -26943},
        {"first": 26943, "count": 1},
        {"count": 14, "first": -26000},
        {"count": 64, "step": 65535},
    ],
)
def test_a_plan_beyond_the_limits_of_the_table_is_refused(pure_modules, changes):
    assert pure_modules.ask("plan", *plan(**changes)) == "0"


@given(st.integers(-32768, 32767), st.integers(0, 65535), st.integers(1, 64))
def test_a_plan_is_possible_only_within_148_degrees(pure_modules, first, step, count):
    outermost = 148 / 360 * 65536
    last = first + step * (count - 1)
    assume(all(abs(abs(end) - outermost) > 1 for end in (first, last)))
    expected = -outermost <= first and last <= outermost
    assert pure_modules.ask("plan", *plan(first=first, step=step, count=count)) == str(int(expected))


@pytest.mark.parametrize(
    "calibration",
    [
        (DEFAULT_TURN, 0, 0, -27307),
        (3800 * 256, 128, 1, -32768),
        (4400 * 256, 0, 2, math.floor(-148 * 65536 / 360)),
    ],
)
def test_a_calibration_at_the_limits_of_the_table_is_possible(pure_modules, calibration):
    assert pure_modules.ask("calibration", *calibration) == "1"


@pytest.mark.parametrize(
    "calibration",
    [
        (3800 * 256 - 1, 0, 0, -27307),
        (4400 * 256 + 1, 0, 0, -27307),
        (DEFAULT_TURN, 129, 0, -27307),
        (DEFAULT_TURN, 0, 3, -27307),
        (DEFAULT_TURN, 0, 0, math.floor(-148 * 65536 / 360) + 1),
        (DEFAULT_TURN, 0, 0, 32767),
    ],
)
def test_a_calibration_beyond_the_limits_of_the_table_is_refused(pure_modules, calibration):
    assert pure_modules.ask("calibration", *calibration) == "0"
