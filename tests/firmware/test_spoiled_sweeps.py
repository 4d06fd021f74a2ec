"""Sweeps that memory spoils while they wait: whatever the ring holds, rounds stay short, on the slowest chip too."""

from collections.abc import Callable, Iterable
from random import Random

import pytest
from firmware.flood import flood
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    AskStatus,
    Configure,
    Hello,
    Outcome,
    Reset,
    Single,
    Start,
    State,
    Status,
    Sweep,
)

# The watchdog allows 65,280 ticks of 0.25 us (firmware/hal/watchdog.c). A third of it, and 1.5 in reserve.
LONGEST_WORK_US = 16_320 / 3 / 1.5
# firmware/src/core/ring.c: control.oldest, and the memory, where the first slot begins. A slot begins with its mark
# and the length of its frame, and fills blocks of 12 bytes.
RING_OLDEST = 0x0404
RING = 0x040C
SLOT_OF_13 = 144  # bytes: 3 + 27 + 13 * 8 + 4, rounded up
SLOT_OF_64 = 552
MARK, LENGTH_LOW, LENGTH_HIGH, CONTENT = 0, 1, 2, 40
# The default plan, and one of the most readings, as quick as can be.
OF_13 = Configure(0, -24576, 4096, 13, 60, 600, 100, 20, 1)
OF_64 = Configure(0, -24576, 700, 64, 29, 800, 50, 0, 1)
OPTIONS = ("--laps", "0", "--slowest-chip")


def fill_the_ring(unit: SteppedUnit, plan: Configure) -> int:
    """Have the unit sweep, unacknowledged, until no more sweeps fit; how many there are."""
    unit.greet()
    assert unit.command(plan) == unit.command(Start(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.WAITING, 300.0)
    return unit.ask(AskStatus(0), Status).sweeps_waiting


def spoil(unit: SteppedUnit, addresses: Iterable[int]) -> None:
    for address in addresses:
        unit.inject("memory_spoiled", address=address)


def deliver(unit: SteppedUnit, until: Callable[[list[int]], bool]) -> list[int]:
    """The numbers of the sweeps that come, each acknowledged at once."""
    unit.take(Sweep)
    numbers: list[int] = []
    while not until(numbers):
        sweep = unit.receive(Sweep, 60.0)
        unit.acknowledge(sweep)
        numbers.append(sweep.sequence)
    return numbers


@pytest.mark.parametrize("byte", [MARK, LENGTH_LOW, LENGTH_HIGH, CONTENT])
@pytest.mark.parametrize(
    ("plan", "slot_bytes", "spoiled"),
    [
        pytest.param(OF_13, SLOT_OF_13, {0}, id="oldest of 21"),
        pytest.param(OF_13, SLOT_OF_13, {0, 6, 7, 12, 20}, id="five of 21"),
        pytest.param(OF_13, SLOT_OF_13, set(range(21)), id="all 21"),
        pytest.param(OF_64, SLOT_OF_64, {0}, id="oldest of 5"),
        pytest.param(OF_64, SLOT_OF_64, {0, 1, 2, 3, 4}, id="all 5"),
    ],
)
def test_spoiled_sweeps_in_a_full_ring_are_dropped_and_the_unit_goes_on_sweeping(plan, slot_bytes, spoiled, byte):
    with stepped_unit(*OPTIONS) as unit:
        stored = fill_the_ring(unit, plan)
        spoil(unit, (RING + number * slot_bytes + byte for number in sorted(spoiled)))
        last = stored + 2  # sweeps that were made after the ring was full
        numbers = deliver(unit, lambda numbers: bool(numbers) and numbers[-1] >= last)
        status = unit.ask(AskStatus(0), Status)
        assert unit.truth["resets"] == 0
        assert status.homed and status.started
        assert numbers == [number for number in range(last + 1) if number not in spoiled]
        assert status.sweeps_waiting <= 1
        assert unit.truth["longest_work_us"] < LONGEST_WORK_US


def test_after_a_reset_the_spoiled_sweeps_are_dropped_too_and_the_others_delivered():
    spoiled = {0, 3, 4, 19}
    with stepped_unit(*OPTIONS) as unit:
        stored = fill_the_ring(unit, OF_13)
        spoil(unit, (RING + number * SLOT_OF_13 + LENGTH_HIGH for number in sorted(spoiled)))
        unit.command(Reset(0))
        assert unit.receive(Hello).request == 0
        sound = [number for number in range(stored) if number not in spoiled]
        assert deliver(unit, lambda numbers: len(numbers) == len(sound)) == sound
        unit.run(0.1)
        status = unit.ask(AskStatus(0), Status)
        assert (status.sweeps_waiting, status.ring_used) == (0, 0)
        assert unit.truth["longest_work_us"] < LONGEST_WORK_US


def test_acknowledged_sweeps_do_not_come_back_when_the_ring_forgets_where_it_begins():
    with stepped_unit(*OPTIONS) as unit:
        unit.greet()
        for _ in range(3):
            assert unit.command(Single(0)) == Outcome.DONE
            unit.acknowledge(unit.receive(Sweep, 60.0))
        assert unit.ask(AskStatus(0), Status).ring_used == 0
        # Blocks 0 to 35 have been used: the empty ring begins at 36, and with that byte flipped at 219, from where it
        # goes round to 0 and over the old slots.
        spoil(unit, [RING_OLDEST])
        unit.run(5.0)
        assert unit.take(Sweep) == []
        assert unit.ask(AskStatus(0), Status).ring_used == 0


def test_the_longest_sweeps_on_a_line_that_is_never_silent_leave_the_watchdog_two_thirds():
    with stepped_unit(*OPTIONS) as unit:
        fill_the_ring(unit, OF_64)
        sweeps = flood(unit, 20.0, Random(1))
        assert len(sweeps) > 5
        unit.run(1.0)
        assert unit.truth["resets"] == 0
        assert unit.truth["longest_work_us"] < LONGEST_WORK_US
