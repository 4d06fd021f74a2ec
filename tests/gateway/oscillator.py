"""A unit's oscillator and the line to it, as far as a clock exchange shows them."""

from dataclasses import dataclass
from random import Random

from noctule_gateway.clock.regression import TICK_S, Exchange

QUICK, EVERY_S = 8, 0.97
TOLERANCE = 0.015  # of the C8051F340's internal oscillator: datasheet


@dataclass
class Oscillator:
    """A unit's ticks from its boot on, fast by ``drift``."""

    drift: float
    booted_s: float = 990.0

    def tick(self, host_s: float) -> int:
        return int((host_s - self.booted_s) * (1 + self.drift) / TICK_S)


def exchanges(
    unit: Oscillator, count: int, seed: int, outliers: float = 0.0, begin_s: float = 1000.0
) -> list[Exchange]:
    """0.5 ms and an exponential 1 ms each way, held 0.3 ms by the unit; an outlier waits 200 ms more on one way."""
    random = Random(seed)
    result = []
    sent_s = begin_s
    for number in range(count):
        there_s, back_s = (0.0005 + random.expovariate(1000) for _ in range(2))
        if random.random() < outliers:
            there_s, back_s = (there_s + 0.2, back_s) if random.random() < 0.5 else (there_s, back_s + 0.2)
        received_s = sent_s + there_s
        answered_s = received_s + 0.0003 + back_s
        result.append(Exchange(sent_s, unit.tick(received_s), unit.tick(received_s + 0.0003), answered_s))
        sent_s += 0.005 if number < QUICK else EVERY_S
    return result
