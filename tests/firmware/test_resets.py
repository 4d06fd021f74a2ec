"""What resets a unit, what it says of it, and what outlives it: the sweeps in the ring, above all."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from firmware.images import built_with_fault
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    AskHello,
    AskStatus,
    Configure,
    Hello,
    Outcome,
    Reset,
    Result,
    SetWaypoint,
    Single,
    Start,
    State,
    Status,
    Sweep,
)

# RSTSRC (datasheet chapter "Reset Sources"): power-up or supply monitor, watchdog, software
POWER, WATCHDOG, SOFTWARE = 0x02, 0x08, 0x10
# firmware/README.md: HELLO's reset_note
NO_NOTE, NOTE_RESET, NOTE_CANARY = 0, 1, 2
# Each takes 27 + 8 + 4 bytes and 3 of its slot's, in blocks of 12 that is 48 of 3,048.
SWEEPS_OF_ONE_READING = 63
QUICK = Configure(0, -24576, 0, 1, 29, 800, 50, 0, 1)


def sweep_once(unit: SteppedUnit) -> Sweep:
    """Makes a sweep and leaves it in the ring."""
    assert unit.command(Single(0)) == Outcome.DONE
    return unit.receive(Sweep, 30.0)


def waiting(unit: SteppedUnit) -> int:
    return unit.ask(AskStatus(0), Status).sweeps_waiting


def test_a_power_up_says_that_it_was_one():
    with stepped_unit("--laps", "0") as unit:
        hello = unit.receive(Hello)
        assert (hello.request, hello.boot, hello.reset_cause, hello.reset_note) == (0, 1, POWER, NO_NOTE)


def test_reset_is_answered_first_and_says_that_it_was_asked_for():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.send(Reset(17))
        first = unit.receive_either(Result, Hello)
        assert first == Result(17, Reset.TYPE, Outcome.DONE)
        hello = unit.receive(Hello)
        assert (hello.request, hello.boot, hello.reset_cause, hello.reset_note) == (0, 2, SOFTWARE, NOTE_RESET)
        # What the note says is of one reset alone.
        unit.inject("power_cut", for_s=0.2)
        hello = unit.receive(Hello)
        assert (hello.boot, hello.reset_cause, hello.reset_note) == (3, POWER, NO_NOTE)


def test_the_answer_to_reset_waits_for_a_long_sweep_before_it_and_still_goes_out():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(replace(QUICK, count=64)) == Outcome.DONE
        sweep = sweep_once(unit)
        # HELLO has the sweep sent again once its CRC is checked, in five rounds; 545 bytes take 47 ms of the line.
        unit.ask(AskHello(0), Hello)
        unit.run(0.02)
        unit.send(Reset(17))
        assert unit.receive_either(Sweep, Result) == sweep
        assert unit.receive_either(Result, Hello) == Result(17, Reset.TYPE, Outcome.DONE)
        assert unit.receive(Hello).reset_note == NOTE_RESET


def test_a_unit_resets_in_the_midst_of_a_sweep_too():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        assert unit.command(Single(0)) == Outcome.DONE
        unit.wait_for_state(State.SWEEPING)
        assert unit.command(Reset(0)) == Outcome.DONE
        assert unit.receive(Hello).reset_note == NOTE_RESET
        status = unit.ask(AskStatus(0), Status)
        assert (status.state, status.homed, status.sweeps_waiting) == (State.IDLE, False, 0)


def test_nothing_is_obeyed_between_reset_and_the_reset():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.send(Reset(17))
        unit.send(Single(18))
        assert unit.receive_either(Result, Hello) == Result(17, Reset.TYPE, Outcome.DONE)
        assert isinstance(unit.receive_either(Result, Hello), Hello)


@pytest.fixture(scope="module")
def hanging(tmp_path_factory) -> Path:
    """A firmware whose main loop hangs once the waypoint is 666."""
    feed = "        watchdog_feed();\n"
    hang = feed + "        while (unit_waypoint() == 666)\n            ;\n"
    return built_with_fault(tmp_path_factory.mktemp("hanging"), "src/main.c", (feed, hang))


@pytest.fixture(scope="module")
def recursing(tmp_path_factory) -> Path:
    """A firmware that calls itself as many times as the waypoint says, before it looks at its stack."""
    feed = "        watchdog_feed();\n"
    recursion = feed + "        if (unit_waypoint() != WAYPOINT_NONE)\n            descend(unit_waypoint());\n"
    start = "static void start(void)\n"
    descend = (
        "static volatile __xdata uint8_t depth;\n"
        "static void descend(uint16_t levels)\n{\n"
        "    if (levels != 0)\n        descend(levels - 1);\n    depth++;\n}\n\n"
    )
    folder = tmp_path_factory.mktemp("recursing")
    return built_with_fault(folder, "src/main.c", (feed, recursion), (start, descend + start))


def test_a_main_loop_that_hangs_is_reset_by_the_watchdog_and_loses_no_sweep(hanging):
    with stepped_unit("--laps", "0", image=hanging) as unit:
        unit.greet()
        sweep = sweep_once(unit)
        at_s = unit.now_s
        ask_for_a_reset(unit)
        unit.receive(Hello)
        start_s = unit.now_s - at_s
        unit.send(SetWaypoint(1, 666))
        at_s = unit.now_s
        hello = unit.receive(Hello)
        assert (hello.boot, hello.reset_cause, hello.reset_note) == (3, WATCHDOG, NO_NOTE)
        # firmware/README.md, Layout: the watchdog allows 16 ms
        assert unit.now_s - at_s < start_s + 0.02
        assert unit.receive(Sweep) == sweep


def test_a_stack_that_meets_its_canary_resets_the_unit_and_loses_no_sweep(recursing):
    with stepped_unit("--laps", "0", image=recursing) as unit:
        unit.greet()
        sweep = sweep_once(unit)
        free = [unit.ask(AskStatus(0), Status).stack_free]
        unit.send(SetWaypoint(1, 1))
        while isinstance(answer := unit.receive_either(Status, Hello), Status):
            free.append(answer.stack_free)
            unit.send(SetWaypoint(len(free), len(free)))
        assert (answer.boot, answer.reset_cause, answer.reset_note) == (2, SOFTWARE, NOTE_CANARY)
        # The nearer it comes the less is free, until less is left than a call (2 bytes) and an interrupt (13) need.
        assert free == sorted(free, reverse=True)
        assert free[-1] < 2 + 13
        assert unit.receive(Sweep) == sweep


def brown_out(unit: SteppedUnit) -> None:
    unit.inject("brown_out")


def power_cut(unit: SteppedUnit) -> None:
    unit.inject("power_cut", for_s=0.2)


def ask_for_a_reset(unit: SteppedUnit) -> None:
    assert unit.command(Reset(0)) == Outcome.DONE


@pytest.mark.parametrize(("happen", "cause"), [(brown_out, POWER), (power_cut, POWER), (ask_for_a_reset, SOFTWARE)])
def test_a_reset_is_told_and_the_unit_goes_on(happen: Callable[[SteppedUnit], None], cause):
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        happen(unit)
        assert unit.receive(Hello).reset_cause == cause
        assert sweep_once(unit).boot == 2


def sequences_left_after_a_dip(seed: int) -> list[int]:
    """What is left, in the order in which it is sent, of a ring full of sweeps."""
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        unit.greet()
        assert unit.command(QUICK) == unit.command(Start(0, 0)) == Outcome.DONE
        unit.wait_for_state(State.WAITING, 120.0)
        assert waiting(unit) == SWEEPS_OF_ONE_READING
        brown_out(unit)
        assert unit.receive(Hello).reset_cause == POWER
        left = []
        while waiting(unit) != 0:
            sweep = unit.receive(Sweep)
            unit.acknowledge(sweep)
            if sweep.sequence not in left:
                left.append(sweep.sequence)
        return left


def test_sweeps_outlive_a_dip_of_the_supply_but_for_those_that_it_harmed():
    left = [sequences_left_after_a_dip(seed) for seed in range(1, 13)]
    assert all(numbers == sorted(numbers) for numbers in left)
    # A dip changes 8 bytes at the most (simulator/README.md), rarely those by which the ring is known.
    kept = sorted(map(len, left))
    assert kept[1] >= SWEEPS_OF_ONE_READING - 8
    assert kept[0] < SWEEPS_OF_ONE_READING


def test_a_power_up_finds_other_memory_and_begins_with_an_empty_ring():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        sweep_once(unit)
        power_cut(unit)
        unit.receive(Hello)
        assert waiting(unit) == 0
        assert sweep_once(unit).sequence == 0
