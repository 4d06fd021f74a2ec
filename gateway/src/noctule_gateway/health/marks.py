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
ALIKE_M = 0.012  # readings of one reflector: noise of 3 mm, and a cycle of 40 kHz late, 4.3 mm
_ALONE_M, _TOGETHER_M = 0.0043, 0.002  # what each reading of a mark errs by, and all of them together


@dataclass(frozen=True)
class Mark:
    """A mark in the last sweeps: its direction, its range in the past, and how much longer it is now, by ``heard``
    readings that agree.
    """

    direction_rad: float
    range_m: float
    longer_m: float
    heard: int

    @property
    def sigma_m(self) -> float:
        """Standard deviation of ``longer_m``."""
        return math.sqrt(_TOGETHER_M**2 + _ALONE_M**2 / self.heard)


def marks_of(sweeps: Sequence[Readings], past: Past, off: int = 0) -> list[Mark]:
    """Marks of the past that at least two readings hear which agree, and more than a third as many as the mark has
    bearings.

    A motion also moves a mark by a bearing, so that half of a short run's readings may be silent. ``off`` is in half
    steps between bearings: a reading looks where the past looked that much farther on.
    """
    found = []
    for run in runs_of(past):
        by_sweep_m = [
            [
                sweep.range_m[n - off // 2] - past.median_m[n]
                for n in run
                if 0 <= n - off // 2 < len(sweep.range_m) and not math.isnan(sweep.range_m[n - off // 2])
            ]
            for sweep in sweeps
        ]
        agree = _most_alike(by_sweep_m)
        if len(agree) < _LEAST_HEARD or len(agree) * 3 <= len(run):
            continue
        direction_rad = sum(sweeps[-1].bearing_rad[n] for n in run) / len(run)
        range_m = median(past.median_m[n] for n in run)
        found.append(Mark(direction_rad, range_m, median(agree), len(agree)))
    return found


def _most_alike(by_sweep: Sequence[Sequence[float]]) -> list[float]:
    """The readings of all sweeps that are near the one which most others of the last sweep are near.

    Earlier sweeps may be from before the fault, so they choose that one only where no two of the last sweep agree.
    """
    every = [one for each in by_sweep for one in each]
    for among in (by_sweep[-1], every):
        middle = max(among, key=lambda one: sum(abs(one - other) <= ALIKE_M for other in among), default=math.nan)
        if sum(abs(middle - other) <= ALIKE_M for other in among) >= _LEAST_HEARD:
            return [one for one in every if abs(middle - one) <= ALIKE_M]
    return []


def runs_of(past: Past) -> list[list[int]]:
    """The reflectors that two or more bearings hear: one that a single bearing hears is no mark."""
    return [run for run in reflectors_of(past) if len(run) >= 2]


def reflectors_of(past: Past) -> list[list[int]]:
    """Runs of stable bearings at one range."""
    runs: list[list[int]] = []
    for number in past.stable():
        last = runs[-1][-1] if runs else -2
        joined = number == last + 1 and abs(past.median_m[number] - past.median_m[last]) <= _ONE_REFLECTOR_M
        if joined:
            runs[-1].append(number)
        else:
            runs.append([number])
    return runs
