"""Looks: every reading of a fine sweep, those that heard nothing included.

A gap is evidence only where somebody looked. Coarse sweeps look past most of what is there, so along a dense path they
have no looks: what one sweep misses the next one hears. From rare stops there is nothing else to go by.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noctule_mapper.readings import arrays
from noctule_mapper.readings.echoes import Echoes, rows_of
from noctule_mapper.readings.sweep import SweepReadings

_SWEEPS_OF_A_PLACE = 4  # the newest stand for all
_NOTHING_M = 1e6  # the range of a look that heard nothing: beyond all that can be heard


@dataclass(frozen=True)
class Looks:
    """Looks (n,), none for readings that failed in another way.

    ``weight`` is one over the number of sweeps that looked from the same place, for they share their errors: what
    passes by, what swallows sound.
    """

    echoes: Echoes
    weight: np.ndarray

    @cached_property
    def sigma_m(self) -> np.ndarray:
        """Of a range, the errors that it shares with others in it, (n,)."""
        return np.hypot(self.echoes.sigma_m, self.echoes.shared_sigma_m)


Pose = tuple[str, float, float, float]
"""Of a unit that stands still, by its name."""


def pose_of(sweep: SweepReadings) -> Pose:
    """Where the sweep was made, and by which unit."""
    return sweep.unit, sweep.x_m, sweep.y_m, sweep.heading_rad


def is_fine(sweep: SweepReadings) -> bool:
    """Whether a reflector answers several of the sweep's bearings."""
    return sweep.step_rad < sweep.beam_width_rad / 2


def looks_of(
    sweeps: Iterable[SweepReadings], assumed_sigma_m: float, units: Mapping[str, int] | None = None
) -> Looks | None:
    """The looks of the fine ones among ``sweeps``, None where there are none; ``units`` numbers the units."""
    return looks_of_all(filter(is_fine, sweeps), assumed_sigma_m, units)


def looks_of_all(
    sweeps: Iterable[SweepReadings], assumed_sigma_m: float, units: Mapping[str, int] | None = None
) -> Looks | None:
    """The looks of all ``sweeps``, None where there are none; ``units`` numbers the units."""
    by_place: dict[Pose, list[SweepReadings]] = {}
    for sweep in sweeps:
        by_place.setdefault(pose_of(sweep), []).append(sweep)
    parts = []
    for held in by_place.values():
        newest = held[-_SWEEPS_OF_A_PLACE:]
        number = units[newest[0].unit] if units else 0
        for sweep in newest:
            heard = np.isfinite(sweep.range_m)
            range_m = np.where(heard, sweep.range_m, _NOTHING_M)
            rows = rows_of(sweep, heard | sweep.no_echo, range_m, 0, assumed_sigma_m, number)
            parts.append(Looks(rows, np.full(len(rows), 1 / len(newest))))
    return arrays.join(parts) if parts else None
