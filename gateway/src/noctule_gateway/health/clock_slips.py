"""Echoes that are off by one turn of the chip's counter: 2^16 ticks of 0.25 us, 16.384 ms, 2.81 m there and back.

Of a reading 4 % are false, anywhere within 4 m, so that one falls within 2 cm of either place that a slip leads to with
0.0004 at the most: three of sixty in two sweeps come by chance once in 4e5 pairs, four once in 3e7.
"""

import math

from noctule import messages_pb2 as messages
from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past
from noctule_gateway.health.suspicion import Suspicion

_SLIP_S = 16.384e-3
_NEAR_M = 0.025
_LEAST = 4  # slips, in this sweep and the one before
_FITTING_SHARE = 0.6  # of the echoes that have not slipped
_NATS_EACH = math.log(1 / 0.0008)


class ClockSlips:
    """Remembers how many slips the sweep before had."""

    def __init__(self) -> None:
        self._before = 0

    def suspicions(self, look: Look, past: Past | None) -> list[Suspicion]:
        """Without a past there is nothing to compare with: a hall's walls may be 6 m off."""
        slips = 0 if past is None else _off_by_a_turn(look, past)
        both, self._before = slips + self._before, slips
        if not slips or both < _LEAST:
            return []
        words = f"{both} echoes of two sweeps are off by a turn of the chip's counter, 16.384 ms"
        return [Suspicion(messages.FAULT_KIND_CLOCK_SLIPS, both * _NATS_EACH, words)]


def _off_by_a_turn(look: Look, past: Past) -> int:
    """None where the other echoes do not fit the past: then it is something else."""
    stable, slip_m = set(past.stable()), _SLIP_S * look.speed_m_s / 2
    off_m = [abs(look.range_m[n] - past.median_m[n]) for n in look.heard if n in stable]
    slips = sum(abs(one_m - slip_m) <= _NEAR_M for one_m in off_m)
    fitting = sum(one_m <= _NEAR_M for one_m in off_m)
    return slips if fitting >= _FITTING_SHARE * (len(off_m) - slips) else 0
