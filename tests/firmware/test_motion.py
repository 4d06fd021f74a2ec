"""Where the motor goes and how fast: bearings in half steps, ramps, and the plans that are possible."""

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

# The 28BYJ-48's gears, counted by many hands: 32/9 * 22/11 * 26/9 * 31/10, and 64 half steps for a turn of the rotor.
HALF_STEPS_PER_TURN = 32 / 9 * 22 / 11 * 26 / 9 * 31 / 10 * 64

bearings = st.integers(-32768, 32767)
half_steps = st.integers(-2037, 2037)


def test_a_turn_has_4075_77_half_steps():
    # firmware/README.md: 4075.77 half steps per revolution
    assert pytest.approx(4075.77, abs=0.005) == HALF_STEPS_PER_TURN


@given(bearings)
def test_a_bearing_goes_to_the_nearest_half_step(pure_modules, bearing):
    exact = bearing * HALF_STEPS_PER_TURN / 65536
    assert abs(int(pure_modules.ask("half_step", bearing)) - exact) <= 0.5 + 1e-9


@given(half_steps)
def test_a_half_step_has_the_nearest_bearing(pure_modules, half_step):
    exact = half_step * 65536 / HALF_STEPS_PER_TURN
    assert abs(int(pure_modules.ask("bearing", half_step)) - exact) <= 0.5 + 1e-9


@given(half_steps)
def test_going_where_one_is_moves_nothing(pure_modules, half_step):
    assert int(pure_modules.ask("half_step", pure_modules.ask("bearing", half_step))) == half_step


@given(st.integers(50, 1000), st.integers(0, 1000))
def test_intervals_are_those_of_constant_acceleration(pure_modules, top_speed, ramp_ms):
    *ramp, cruise = map(int, pure_modules.ask("ramp", top_speed, ramp_ms, 512).split())
    assert cruise == 1_000_000 // top_speed
    for level, interval_us in enumerate(ramp, start=1):
        # v^2 = 2 a n with a = top speed / ramp time
        speed = math.sqrt(2 * top_speed / (ramp_ms / 1000) * level) if ramp_ms else math.inf
        expected = min(max(1e6 / speed, cruise), 20_000)
        # firmware/src/ramp.c: within 0.8 % past level 128; truncations make up to 5 us everywhere
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
        {"speed": 1000},
        {"ramp": 0, "settle": 0},
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
        {"speed": 1001},
        {"ramp": 1001},
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
