"""How much the ranges scatter at the bearings that used to be stable: about their past, and from sweep to sweep.

A sound unit's median deviation is 2 to 3 mm, or 5 with late echoes; its false echoes, one in twenty-five, don't move a
median. 15 mm at half of the bearings, about the past and about the sweep before alike, is neither the room nor a
motion, which repeats itself.
"""

import math
from statistics import median

from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past

NOISY_M = 0.015
_LEAST_BOTH = 8  # bearings


def scatter_m(look: Look, past: Past) -> float | None:
    """Median deviation from the past; None where too few bearings answer."""
    off = [abs(look.range_m[n] - past.median_m[n]) for n in past.stable() if not math.isnan(look.range_m[n])]
    return median(off) if len(off) >= _LEAST_BOTH else None


def change_m(look: Look, before: Look, past: Past) -> float | None:
    """Median change since the sweep before, at the same bearings."""
    both = [abs(look.range_m[n] - before.range_m[n]) for n in past.stable()]
    both = [one for one in both if not math.isnan(one)]
    return median(both) if len(both) >= _LEAST_BOTH else None
