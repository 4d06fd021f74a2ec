"""Turns to speak: a unit pings at the ticks that START names, and at no others (firmware/README.md, Turns)."""

from dataclasses import replace

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    AskClock,
    AskStatus,
    Clock,
    Configure,
    NoEcho,
    Outcome,
    Single,
    Start,
    State,
    Status,
    Stop,
    Sweep,
)

MS = 4000  # ticks
OPEN_MS = 3  # firmware/README.md, Turns
PERIOD = 97 * MS + 13
# Turns a quarter of the way round and back: some moves are longer than a period.
PLAN = Configure(0, -8192, 2048, 9, 60, 600, 100, 20, 1)


def turns_after(pure_modules, start: int, period: int, now: int, ticks: int) -> list[int]:
    """When a unit may ping, in ticks from ``now``, looking every 0.5 ms."""
    answer = pure_modules.ask("turns", start % 2**32, period, now % 2**32, ticks, MS // 2)
    *turns, is_set, may_ping = map(int, answer.split())
    assert (is_set, may_ping) == (0, 1)  # after turns_clear()
    return turns


@pytest.mark.parametrize("now", [0, 5_000_000, 2**32 - 1, 2**32 - 40 * MS], ids=hex)
@pytest.mark.parametrize("ahead", [0, 1, -1, 500 * MS, -500 * MS, 530_000 * MS, -530_000 * MS])
def test_turns_come_at_whole_periods_from_the_given_tick_on_either_side_of_it(pure_modules, now, ahead):
    period = 50 * MS
    turns = turns_after(pure_modules, now + ahead, period, now, 20 * period)
    first = ahead % period
    begun = [] if first == 0 or period - first >= OPEN_MS * MS else [first - period]
    due = [max(0, turn) for turn in (*begun, *range(first, 19 * period, period))]
    assert turns[: len(due)] == [-(-turn // (MS // 2)) * (MS // 2) for turn in due]


@pytest.mark.parametrize("period", [0, 29 * MS - 1, 4_000 * MS + 1, 2**32 - 1])
def test_a_period_that_no_unit_could_keep_is_refused(pure_modules, period):
    assert pure_modules.ask("turns", 0, period, 0, 1, 1) == "refused"


@pytest.fixture
def unit():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(PLAN) == Outcome.DONE
        yield unit


def pings(sweep: Sweep) -> list[int]:
    """The ticks of its triggers, to 4 us."""
    return [sweep.start + 16 * reading.offset for reading in sweep.readings]


def late_ms(sweep: Sweep, turn: int) -> list[float]:
    """By how much each of its pings was later than a turn."""
    return [(tick - turn) % PERIOD / MS for tick in pings(sweep)]


def next_sweep(unit: SteppedUnit) -> Sweep:
    sweep = unit.receive(Sweep, 60.0)
    unit.acknowledge(sweep)
    return sweep


def now(unit: SteppedUnit) -> int:
    return unit.ask(AskClock(0), Clock).sent


def test_every_ping_of_every_sweep_goes_out_at_a_turn(unit):
    turn = now(unit) + 1000 * MS
    assert unit.command(Start(0, 300, turn, PERIOD)) == Outcome.DONE
    for _ in range(4):
        assert max(late_ms(next_sweep(unit), turn)) <= OPEN_MS


@pytest.mark.parametrize("number", [3, 5])
def test_each_ping_of_a_reading_of_several_waits_for_its_turn(unit, number):
    assert unit.command(replace(PLAN, pings=number)) == Outcome.DONE
    turn = now(unit)
    assert unit.command(Start(0, 0, turn, PERIOD)) == Outcome.DONE
    sweep = next_sweep(unit)
    assert max(late_ms(sweep, turn)) <= OPEN_MS
    steps = [b - a for a, b in zip(pings(sweep), pings(sweep)[1:], strict=False)]
    assert min(steps) >= number * PERIOD - OPEN_MS * MS


def test_turns_go_on_over_the_wrap_of_the_count(unit):
    unit.run(2**32 / 4e6 - unit.now_s - 20.0)
    turn = now(unit) - 7_000 * MS
    assert turn < 2**32 < turn + 60_000 * MS
    assert unit.command(Start(0, 0, turn, PERIOD)) == Outcome.DONE
    sweeps = [next_sweep(unit) for _ in range(8)]
    assert sweeps[0].start < 2**32 < sweeps[-1].start
    assert max(late for sweep in sweeps for late in late_ms(sweep, turn)) <= OPEN_MS


def test_turns_are_kept_over_a_long_pause_and_can_be_moved_in_the_midst_of_a_sweep(unit):
    turn = now(unit)
    assert unit.command(Start(0, 20_000, turn, PERIOD)) == Outcome.DONE
    next_sweep(unit)
    assert max(late_ms(next_sweep(unit), turn)) <= OPEN_MS
    moved = turn + 41 * MS
    assert unit.command(Start(0, 0, moved, PERIOD)) == Outcome.DONE
    assert max(late_ms(next_sweep(unit), moved)) <= OPEN_MS


def test_a_start_without_turns_ends_them_and_the_status_says_which(unit):
    assert unit.greet_again().knows_turns
    assert unit.command(Start(0, 0, now(unit), PERIOD)) == Outcome.DONE
    assert unit.ask(AskStatus(0), Status).in_turn
    in_turns = [next_sweep(unit) for _ in range(2)][-1]
    assert unit.command(Start(0, 0)) == Outcome.DONE
    assert not unit.ask(AskStatus(0), Status).in_turn
    free = [next_sweep(unit) for _ in range(2)][-1]
    assert max(late_ms(free, in_turns.start)) > 2 * OPEN_MS
    assert unit.command(Stop(0)) == Outcome.DONE


@pytest.mark.parametrize("period", [29 * MS - 1, 4_000 * MS + 1])
def test_turns_out_of_range_leave_the_unit_as_it_was(unit, period):
    assert unit.command(Start(0, 0, now(unit), period)) == Outcome.OUT_OF_RANGE
    assert unit.command(Start(0, 0, now(unit) + 2**33, PERIOD)) == Outcome.OUT_OF_RANGE
    status = unit.ask(AskStatus(0), Status)
    assert not status.started and not status.in_turn


def test_a_stop_ends_the_turns_after_the_reading_under_way_and_a_start_gives_them_again(unit):
    turn = now(unit)
    assert unit.command(Start(0, 0, turn, PERIOD)) == Outcome.DONE
    unit.receive(Sweep, 60.0)
    unit.run(2.0)
    assert unit.command(Stop(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    assert not unit.ask(AskStatus(0), Status).in_turn
    unit.run(1.0)
    while unit.ask(AskStatus(0), Status).sweeps_waiting:
        assert max(late_ms(next_sweep(unit), turn)) <= OPEN_MS
    assert unit.command(Single(0)) == Outcome.DONE
    assert max(late_ms(next_sweep(unit), turn)) > OPEN_MS
    assert unit.command(Start(0, 0, turn, PERIOD)) == Outcome.DONE
    assert unit.ask(AskStatus(0), Status).in_turn
    assert max(late_ms(next_sweep(unit), turn)) <= OPEN_MS


def test_a_line_that_is_high_for_a_moment_while_the_unit_waits_for_its_turn_is_not_stuck(unit):
    assert unit.command(replace(PLAN, bearing_step=0)) == Outcome.DONE
    assert unit.command(Start(0, 0, now(unit), 2000 * MS)) == Outcome.DONE
    unit.wait_for_state(State.SWEEPING)
    for _ in range(2 * PLAN.count * 4):  # four times between two turns
        unit.run(0.5)
        unit.inject("sensor_stuck_high", for_s=0.01)
    echoes = [reading.echo for _ in range(2) for reading in next_sweep(unit).readings]
    assert NoEcho.STUCK_HIGH not in echoes
