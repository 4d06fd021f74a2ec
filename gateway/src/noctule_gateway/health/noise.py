"""How much the ranges scatter at the bearings that used to be stable: about their past, among neighbours that hear one
reflector, and from sweep to sweep.

A sound unit's median deviation is 2 to 3 mm, or 5 with late echoes; its false echoes, one in twenty-five, don't move a
median. 15 mm at half of the bearings by the first two together (their geometric mean) and by the third is
neither the room nor a motion: a motion changes neighbours alike, and repeats itself.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from statistics import median

from noctule_gateway.health.marks import runs_of
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

NOISY_M = 0.015
LEAST_M = 0.01  # by each of the first two
_LEAST_BOTH = 6  # bearings
_LEAST_PAIRS = 4


def scatter_m(sweep: Readings, past: Past) -> float | None:
    """Median deviation from the past; None where too few bearings answer."""
    off = [abs(sweep.range_m[n] - past.median_m[n]) for n in past.stable() if not math.isnan(sweep.range_m[n])]
    return median(off) if len(off) >= _LEAST_BOTH else None


def disagreement_m(sweeps: Sequence[Readings], past: Past) -> float | None:
    """Median difference of neighbours that used to hear one reflector, in the last sweep; where too few of them answer,
    in the last two. None where these are too few.
    """
    pairs = [pair for run in runs_of(past) for pair in pairwise(run)]
    for last in (sweeps[-1:], sweeps[-2:]):
        off = [
            abs((sweep.range_m[b] - past.median_m[b]) - (sweep.range_m[a] - past.median_m[a]))
            for sweep in last
            for a, b in pairs
        ]
        off = [one for one in off if not math.isnan(one)]
        if len(off) >= _LEAST_PAIRS:
            return median(off)
    return None


def change_m(sweep: Readings, before: Readings, at: Iterable[int], least: int = _LEAST_BOTH) -> float | None:
    """Median change since the sweep before, at the bearings ``at``; None where fewer than ``least`` answer in both."""
    both = [abs(sweep.range_m[n] - before.range_m[n]) for n in at]
    both = [one for one in both if not math.isnan(one)]
    return median(both) if len(both) >= least else None
