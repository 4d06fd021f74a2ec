"""Echoes that are off by one turn of the chip's counter: 2^16 ticks of 0.25 us, 16.384 ms, 2.81 m there and back.

Of all readings 4 % are false, anywhere within 4 m: one falls within 2.5 cm of the place that a slip leads to with
0.0005 at the most. How many do by chance is a Poisson number; its tail (Chernoff's bound) is the evidence. Each bearing
counts once. It takes slips at three bearings in three sweeps where fourteen answer, and at four where more do.
"""

import math
from collections import deque

from noctule import messages_pb2 as messages
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_SLIP_S = 16.384e-3
_NEAR_M = 0.025
_CHANCE = 0.0005  # of a reading
_SWEEPS = 3
_REPEATED = 2  # echoes at the range of a slip, neither as before nor off by a turn: a value that the sensor makes up
_LEAST_NATS = 11.8  # by chance at most once in 130,000 sweeps
_FITTING_SHARE = 0.6  # of the echoes that have not slipped


class ClockSlips:
    """Remembers at which bearings the last sweeps had slips; one counts once: what stands there is heard again."""

    def __init__(self) -> None:
        self._slips: deque[frozenset[int]] = deque(maxlen=_SWEEPS)

    def suspicions(self, sweep: Readings, past: Past | None) -> list[Suspicion]:
        """Without a past there is nothing to compare with: a hall's walls may be 6 m off."""
        self._slips.append(frozenset() if past is None else _off_by_a_turn(sweep, past))
        slips = len(frozenset().union(*self._slips))
        if past is None or not self._slips[-1]:
            return []
        expected = _CHANCE * _SWEEPS * len(past.stable())
        nats = slips * math.log(slips / expected) - slips + expected
        if nats < _LEAST_NATS:
            return []
        words = f"at {slips} bearings, echoes of {_SWEEPS} sweeps are off by a turn of the chip's counter, 16.384 ms"
        return [Suspicion(messages.FAULT_KIND_CLOCK_SLIPS, nats, words)]


def _off_by_a_turn(sweep: Readings, past: Past) -> frozenset[int]:
    """At which bearings. None where the other echoes do not fit the past: then it is something else."""
    stable, slip_m = set(past.stable()), _SLIP_S * sweep.speed_m_s / 2
    off_m = {n: abs(sweep.range_m[n] - past.median_m[n]) for n in sweep.heard if n in stable}
    slipped = [n for n, one_m in off_m.items() if abs(one_m - slip_m) <= _NEAR_M]
    fitting = [n for n, one_m in off_m.items() if one_m <= _NEAR_M]
    if len(fitting) < _FITTING_SHARE * (len(off_m) - len(slipped)):
        return frozenset()
    others_m = [sweep.range_m[n] for n in set(sweep.heard) - set(slipped) - set(fitting)]
    return frozenset(
        n for n in slipped if sum(abs(one_m - sweep.range_m[n]) <= _NEAR_M for one_m in others_m) < _REPEATED
    )
