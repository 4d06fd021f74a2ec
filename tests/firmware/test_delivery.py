"""When a sweep that nobody acknowledges is sent again (firmware/README.md, "Sweeps are not lost")."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import Ack, AskHello, AskStatus, Single, Sweep

# A round of the tasks, 2 ms, then 137 bytes of a sweep of 13 readings at 115200 bit/s, and a request's before it.
HEARD_S = 0.002 + (137 + 13) * 10 / 115200
# The answer to a HELLO, 26 bytes, goes first, and what follows begins in the next round.
GREETED_S = 0.002 + 26 * 10 / 115200


@pytest.fixture
def unit() -> Iterator[SteppedUnit]:
    """A unit that has just sent its first sweep."""
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.command(Single(0))
        unit.receive(Sweep, within_s=60.0)
        yield unit


def gaps_s(unit: SteppedUnit, count: int) -> list[float]:
    """Between the times that the sweep comes."""
    times_s = [unit.now_s]
    for _ in range(count):
        unit.receive(Sweep)
        times_s.append(unit.now_s)
    return [later - earlier for earlier, later in pairwise(times_s)]


def test_to_a_host_that_is_not_to_be_heard_it_goes_again_ever_more_rarely(unit: SteppedUnit) -> None:
    assert gaps_s(unit, 6) == pytest.approx([0.5, 1.0, 2.0, 4.0, 4.0, 4.0], abs=HEARD_S)


def test_a_frame_of_the_host_begins_the_waits_again(unit: SteppedUnit) -> None:
    gaps_s(unit, 4)
    unit.run(1.0)
    unit.send(AskStatus(9))
    assert gaps_s(unit, 3) == pytest.approx([0.5, 0.5, 1.0], abs=HEARD_S)


def test_an_acknowledgement_of_another_sweep_is_a_frame_of_the_host_too_and_no_more(unit: SteppedUnit) -> None:
    gaps_s(unit, 4)
    unit.send(Ack(boot=60000, sequence=7, serial=1, life=1))
    assert gaps_s(unit, 1) == pytest.approx([0.5], abs=HEARD_S)


def test_a_hello_ends_the_wait_at_once(unit: SteppedUnit) -> None:
    gaps_s(unit, 4)
    unit.send(AskHello(9))
    assert gaps_s(unit, 2) == pytest.approx([0.0, 0.5], abs=HEARD_S + GREETED_S)
