"""Echoes that are off by one turn of the chip's counter: 2^16 ticks of 0.25 us, 16.384 ms, 2.81 m there and back.

Of a reading 4 % are false, anywhere within 4 m, so that one falls within 2 cm of either place that a slip leads to with
0.0004 at the most. So many by chance are a Poisson number; its tail (Chernoff's bound) is the evidence. It takes three
slips in three sweeps where thirteen bearings answer, and four where twenty do.
"""

import math
from collections import deque

from noctule import messages_pb2 as messages
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_SLIP_S = 16.384e-3
_NEAR_M = 0.025
_CHANCE = 0.0004  # of a reading
_SWEEPS = 3
_LEAST_NATS = 12.5
_FITTING_SHARE = 0.6  # of the echoes that have not slipped


class ClockSlips:
    """Remembers how many slips the last sweeps had."""

    def __init__(self) -> None:
        self._slips: deque[int] = deque(maxlen=_SWEEPS)

    def suspicions(self, sweep: Readings, past: Past | None) -> list[Suspicion]:
        """Without a past there is nothing to compare with: a hall's walls may be 6 m off."""
        self._slips.append(0 if past is None else _off_by_a_turn(sweep, past))
        slips = sum(self._slips)
        if past is None or not self._slips[-1]:
            return []
        expected = _CHANCE * _SWEEPS * len(past.stable())
        nats = slips * math.log(slips / expected) - slips + expected
        if nats < _LEAST_NATS:
            return []
        words = f"{slips} echoes of {_SWEEPS} sweeps are off by a turn of the chip's counter, 16.384 ms"
        return [Suspicion(messages.FAULT_KIND_CLOCK_SLIPS, nats, words)]


def _off_by_a_turn(sweep: Readings, past: Past) -> int:
    """None where the other echoes do not fit the past: then it is something else."""
    stable, slip_m = set(past.stable()), _SLIP_S * sweep.speed_m_s / 2
    off_m = [abs(sweep.range_m[n] - past.median_m[n]) for n in sweep.heard if n in stable]
    slips = sum(abs(one_m - slip_m) <= _NEAR_M for one_m in off_m)
    fitting = sum(one_m <= _NEAR_M for one_m in off_m)
    return slips if fitting >= _FITTING_SHARE * (len(off_m) - slips) else 0
