"""What one unit that stands still hears of the room from its place: its plateaus and looks, in the unit's own frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import echoes_of, join
from noctule_mapper.readings.evidence import Evidence, evidence
from noctule_mapper.readings.looks import is_fine, looks_of
from noctule_mapper.readings.plateaus import plateaus
from noctule_mapper.readings.sweep import SweepReadings

LEAST_RANGE_SIGMA_M = 0.002  # an echo may be a cycle late (4.3 mm)
# What the middles of most plateaus err by, counted in random rooms, as a share of a step; a few ran into a neighbour's
# and err by five times as much (``pose_scores``).
_MIDDLE_SHARE = 0.2


@dataclass(frozen=True, eq=False)  # of arrays
class UnitView:
    """A unit's plateaus (n,) and looks (m,); directions and bearings are anticlockwise from where the unit faces.

    ``look_m`` is infinite where nothing was heard.
    """

    unit: str
    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray
    look_rad: np.ndarray
    look_m: np.ndarray

    def nearest_at(self, bearing_rad: np.ndarray) -> np.ndarray:
        """The nearest heard about each bearing, infinite where nothing was; NaN where the unit did not look."""
        return self._nearest_m[np.rint(bearing_rad * _BINS / (2 * np.pi)).astype(int) % _BINS]

    @cached_property
    def _nearest_m(self) -> np.ndarray:
        bearing_rad = np.arange(_BINS) * (2 * np.pi / _BINS)
        near = np.abs(wrapped(bearing_rad[:, None] - self.look_rad)) < _LOOK_RAD
        return np.where(near.any(axis=1), np.where(near, self.look_m, np.inf).min(axis=1), np.nan)

    def __len__(self) -> int:
        return len(self.range_m)


def view_of(unit: str, sweeps: Sequence[SweepReadings], config: MapperConfig) -> UnitView | None:
    """What the unit hears in ``sweeps``, all from one place; None where none of them is fine."""
    own = [
        replace(sweep, x_m=0.0, y_m=0.0, heading_rad=0.0, sigma_position_m=0.0, sigma_heading_rad=0.0)
        for sweep in sweeps[-_SWEEPS:]
        if is_fine(sweep)
    ]
    looks = looks_of(own, config.noise.assumed_sigma_m)
    if looks is None:
        return None
    echoes = join([echoes_of(sweep, number, config.noise.assumed_sigma_m) for number, sweep in enumerate(own)])
    data = evidence(echoes, echoes.sigma_m, config.sensor.longest_range_m, config.refinement)
    flat = plateaus(replace(data, looks=looks), config.refinement)
    surest = np.sort(np.argsort(flat.direction_sigma_rad, kind="stable")[:_MOST_PLATEAUS])
    far_m = config.sensor.longest_range_m
    return UnitView(
        unit=unit,
        direction_rad=flat.echoes.axis_rad[surest],
        direction_sigma_rad=_direction_sigma_rad(flat, config)[surest],
        range_m=flat.echoes.range_m[surest],
        range_sigma_m=np.hypot(flat.range_sigma_m[surest], LEAST_RANGE_SIGMA_M),
        look_rad=looks.echoes.axis_rad,
        look_m=np.where(looks.echoes.range_m > far_m, np.inf, looks.echoes.range_m),
    )


def _direction_sigma_rad(flat: Evidence, config: MapperConfig) -> np.ndarray:
    """Of plateaus that nothing cut short their middles' error, of others also what they may have gone on by."""
    stated = config.refinement.plateaus
    middle_rad = np.hypot(stated.middle_share * flat.echoes.step_rad, stated.least_middle_sigma_rad)
    cut_rad2 = np.maximum(flat.direction_sigma_rad**2 - middle_rad**2, 0)
    return np.sqrt(cut_rad2 + (_MIDDLE_SHARE * flat.echoes.step_rad) ** 2)


_BINS = 360  # of a turn
_LOOK_RAD = np.radians(4.0)  # to the side of a bearing
_MOST_PLATEAUS = 16  # poses by pairs grow with the fourth power
_SWEEPS = 16  # the newest tell enough, and cost no more however many there are
