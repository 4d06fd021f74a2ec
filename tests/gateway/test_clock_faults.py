"""UTC of readings while everything disturbs a clock at once: jitter, flash stalls, resets, a wrap, a host that is set.

Oscillators within the datasheet's 1.5 %, up to 5 ms of delay on each way, stalls of 10 to 20 ms in which the CPU stands
still (flash erase time: datasheet C8051F34x), a counter of 48 bits that begins again, a clock set by two weeks.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from random import Random

import pytest
from gateway.oscillator import EVERY_S, QUICK, TOLERANCE, Oscillator

from noctule_gateway.clock.boot_clocks import BootClocks
from noctule_gateway.clock.regression import TICKS_TO_WRAP, Exchange

UTC_LESS_MONOTONIC_S = 1.79e9
MINUTE_S, FINE_SWEEP_S = 60.0, 10.5  # a fine sweep lasts so long, and is told by its start
SEEDS = range(40)


@dataclass(frozen=True)
class Told:
    """A reading's time of one seed: how long after the boot was seen it was told, its error and the stated one."""

    since_begin_s: float
    error_s: float
    stated_s: float


class World:
    """A unit on a bad line, and the gateway's clocks of it. All its times are the host's monotonic seconds."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.clocks = BootClocks(nominal=False, anchor=lambda _: None)
        self.utc_offset_s = UTC_LESS_MONOTONIC_S
        self.drift = self.random.uniform(-TOLERANCE, TOLERANCE)
        self.boot, self.now_s = 1, 1000.0
        self._units: dict[int, tuple[Oscillator, int]] = {}  # by boot, with the ticks that it began with
        self._power_on(ticks=TICKS_TO_WRAP - round(self.random.uniform(0.0, 300.0) * 4e6))
        self.told: list[Told] = []

    def run(self, duration_s: float) -> None:
        """Exchanges as the link makes them; after each, a sweep of the last seconds is told."""
        until_s, number = self.now_s + duration_s, 0
        while self.now_s < until_s:
            assert self._exchange() or number < QUICK
            self.tell(self.boot, self.now_s - self.random.uniform(0.0, min(FINE_SWEEP_S, self.now_s - self.begun_s)))
            self.now_s += 0.02 if number < QUICK else EVERY_S
            number += 1

    def reset(self) -> None:
        """The unit begins its next boot; it is seen within seconds."""
        self.boot += 1
        self.now_s += self.random.uniform(0.5, 3.0)
        self._power_on(ticks=0)

    def tell(self, boot: int, at_s: float) -> None:
        """Note what the clocks say of a reading at ``at_s``."""
        told = self.clocks.at(boot, self._ticks_of(boot, at_s), self.utc_offset_s)
        error_s = told.time_s - (at_s + self.utc_offset_s)
        self.told.append(Told(self.now_s - self.begun_s, error_s, told.error_s))

    def _power_on(self, ticks: int) -> None:
        self._units[self.boot] = Oscillator(self.drift, self.now_s), ticks
        self.begun_s = self.now_s
        self.clocks.begin(self.boot, self.now_s, self.utc_offset_s)

    def _ticks_of(self, boot: int, at_s: float) -> int:
        unit, ticks = self._units[boot]
        return (unit.tick(at_s) + ticks) % TICKS_TO_WRAP

    def _exchange(self) -> bool:
        there_s, back_s = (0.0002 + self.random.uniform(0.0, 0.005) for _ in range(2))
        if self.random.random() < 0.05:
            stall_s = self.random.uniform(0.01, 0.02)
            there_s, back_s = (there_s + stall_s, back_s) if self.random.random() < 0.5 else (there_s, back_s + stall_s)
        received_s = self.now_s + there_s
        received, sent = (self._ticks_of(self.boot, at_s) for at_s in (received_s, received_s + 0.0003))
        return self.clocks.add(Exchange(self.now_s, received, sent, received_s + 0.0003 + back_s))


def histories() -> Iterator[list[Told]]:
    """Of each seed: two minutes, the host's clock is set, a minute, the unit is reset and its last sweeps come."""
    for seed in SEEDS:
        world = World(seed)
        world.run(world.random.uniform(110.0, 130.0))
        world.utc_offset_s += world.random.choice([-14, 14]) * 86400.0
        world.run(60.0)
        boot, last_s = world.boot, world.now_s
        world.reset()
        world.run(world.random.uniform(1.0, 90.0))
        for _ in range(8):  # the ring outlives the reset
            world.tell(boot, last_s - world.random.uniform(0.0, FINE_SWEEP_S))
        yield world.told


@pytest.fixture(scope="module")
def told() -> list[Told]:
    return [one for history in histories() for one in history]


def test_a_minute_after_a_boot_every_reading_is_told_within_a_millisecond(told: list[Told]) -> None:
    late = [one for one in told if one.since_begin_s > MINUTE_S]
    assert len(late) > 2000
    assert max(abs(one.error_s) for one in late) < 0.001


def test_the_stated_error_covers_the_truth_from_the_first_seconds_on(told: list[Told]) -> None:
    beyond = [one for one in told if abs(one.error_s) > one.stated_s]
    assert not [one for one in beyond if one.since_begin_s > MINUTE_S]
    assert len(beyond) <= 0.01 * len(told)  # of one standard deviation, while little is known
    assert all(abs(one.error_s) <= 3 * one.stated_s for one in told)
