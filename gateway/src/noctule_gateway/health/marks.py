"""The marks that a fixed unit knows its place by: runs of neighbouring bearings that hear one reflector, and by how
much each is farther now than in the past.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

_ONE_REFLECTOR_M = 0.03
_LEAST_HEARD = 2


@dataclass(frozen=True)
class Mark:
    """A mark in the last sweeps: its direction, its range in the past, and how much longer it is now."""

    direction_rad: float
    range_m: float
    longer_m: float


def marks_of(sweeps: Sequence[Readings], past: Past, off: int = 0) -> list[Mark]:
    """The past's marks that two readings hear, and more than a third of all; ``longer_m`` is their median.

    A motion also moves a mark by a bearing, so that half of a short run's readings may be silent. ``off`` is in half
    steps between bearings: a reading looks where the past looked that much farther on.
    """
    found = []
    for run in runs_of(past):
        longer = [
            sweep.range_m[n - off // 2] - past.median_m[n]
            for sweep in sweeps
            for n in run
            if 0 <= n - off // 2 < len(sweep.range_m) and not math.isnan(sweep.range_m[n - off // 2])
        ]
        if len(longer) < _LEAST_HEARD or len(longer) * 3 <= len(run) * len(sweeps):
            continue
        direction_rad = sum(sweeps[-1].bearing_rad[n] for n in run) / len(run)
        found.append(Mark(direction_rad, median(past.median_m[n] for n in run), median(longer)))
    return found


def runs_of(past: Past) -> list[list[int]]:
    """Runs of stable bearings at one range; a bearing alone is no mark where there is a finer plan's neighbour."""
    runs: list[list[int]] = []
    for number in past.stable():
        last = runs[-1][-1] if runs else -2
        joined = number == last + 1 and abs(past.median_m[number] - past.median_m[last]) <= _ONE_REFLECTOR_M
        if joined:
            runs[-1].append(number)
        else:
            runs.append([number])
    return [run for run in runs if len(run) >= 2]
