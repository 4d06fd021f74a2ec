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


@dataclass(frozen=True)
class Mark:
    """A mark in the last sweeps: its direction, its range in the past, and how much longer it is now."""

    direction_rad: float
    range_m: float
    longer_m: float


def marks_of(sweeps: Sequence[Readings], past: Past) -> list[Mark]:
    """The past's marks that more than half of the sweeps' readings hear; ``longer_m`` is the median of these."""
    found = []
    for run in runs_of(past):
        longer = [
            sweep.range_m[n] - past.median_m[n] for sweep in sweeps for n in run if not math.isnan(sweep.range_m[n])
        ]
        if len(longer) * 2 <= len(run) * len(sweeps):
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
