"""Echoes: the readings of many sweeps that heard something, as flat arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noctule_mapper.readings import arrays
from noctule_mapper.readings.sweep import SweepReadings


@dataclass(frozen=True)
class Echoes:
    """Arrays (n,). ``sweep`` is a number that the echoes of one sweep share; ``axis_rad`` is in the site's frame."""

    sweep: np.ndarray
    x_m: np.ndarray
    y_m: np.ndarray
    axis_rad: np.ndarray
    half_beam_rad: np.ndarray
    range_m: np.ndarray
    sigma_m: np.ndarray  # of the range
    calibrated: np.ndarray  # bool: sigma_m is the sensor's own, not assumed
    sigma_position_m: np.ndarray
    sigma_heading_rad: np.ndarray
    step_rad: np.ndarray  # from one bearing of the sweep to the next
    unit: np.ndarray  # a number that the echoes of one unit share
    heading_rad: np.ndarray  # of the unit
    sigma_bias_m: np.ndarray  # of the mean error that all ranges of the unit share
    sigma_scale: np.ndarray  # of the share by which all ranges of the unit are too long: the air's speed of sound
    face_offset_m: np.ndarray  # from the place, on the unit's axis, along the beam to the sensor's face
    sigma_face_m: np.ndarray  # of that, alike for all ranges of the unit
    sense: np.ndarray  # of the unit's turning: 1 anticlockwise, -1 clockwise, 0 where nobody knows

    def __len__(self) -> int:
        return len(self.range_m)

    @cached_property
    def is_fine(self) -> np.ndarray:
        """Which are of sweeps so fine that a reflector answers several bearings, bool (n,)."""
        return self.step_rad < self.half_beam_rad

    @cached_property
    def face_m(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the sensor's face was, x and y, (n,)."""
        if not self.face_offset_m.any():
            return self.x_m, self.y_m
        along = np.cos(self.axis_rad), np.sin(self.axis_rad)
        return self.x_m + self.face_offset_m * along[0], self.y_m + self.face_offset_m * along[1]

    @cached_property
    def shared_sigma_m(self) -> np.ndarray:
        """Of a range, by what all ranges of the unit may have wrong together: its place and, of fine sweeps, which no
        short baselines relate, its sensor; (n,).
        """
        mean_m = np.hypot(self.sigma_bias_m, self.sigma_face_m)
        sensor_m = np.where(self.is_fine, np.hypot(mean_m, self.sigma_scale * self.range_m), 0.0)
        return np.hypot(self.sigma_position_m, sensor_m)

    take = arrays.take


def echoes_of(sweep: SweepReadings, number: int, assumed_sigma_m: float, unit: int = 0) -> Echoes:
    """The echoes of one sweep, numbered ``number``, of the unit numbered ``unit``; ``assumed_sigma_m`` stands in for a
    sensor not calibrated.
    """
    return rows_of(sweep, np.isfinite(sweep.range_m), sweep.range_m, number, assumed_sigma_m, unit)


def rows_of(
    sweep: SweepReadings, chosen: np.ndarray, range_m: np.ndarray, number: int, assumed_sigma_m: float, unit: int
) -> Echoes:
    """The readings ``chosen``, bool (n,), as if they had the ranges ``range_m`` (n,)."""
    alike = np.ones(int(chosen.sum()))
    return Echoes(
        sweep=np.full(len(alike), number),
        x_m=alike * sweep.x_m,
        y_m=alike * sweep.y_m,
        axis_rad=sweep.direction_rad[chosen],
        half_beam_rad=alike * sweep.beam_width_rad / 2,
        range_m=range_m[chosen],
        sigma_m=alike * (sweep.range_sigma_m or assumed_sigma_m),
        calibrated=np.full(len(alike), sweep.range_sigma_m is not None),
        sigma_position_m=alike * sweep.sigma_position_m,
        sigma_heading_rad=alike * sweep.sigma_heading_rad,
        step_rad=alike * sweep.step_rad,
        unit=np.full(len(alike), unit),
        heading_rad=alike * sweep.heading_rad,
        sigma_bias_m=alike * sweep.sigma_bias_m,
        sigma_scale=alike * sweep.sigma_scale,
        face_offset_m=alike * sweep.face_offset_m,
        sigma_face_m=alike * sweep.face_offset_sigma_m,
        sense=np.full(len(alike), _sense(sweep.bearing_rad)),
    )


def _sense(bearing_rad: np.ndarray) -> int:
    """In which sense a unit turned that took its bearings (n,) in this order."""
    signs = np.unique(np.sign(np.diff(bearing_rad)))
    return int(signs[0]) if len(signs) == 1 else 0


def join(parts: Sequence[Echoes]) -> Echoes:
    """Several sets of echoes as one, in their order."""
    return arrays.join(parts or [_NO_ECHOES])


_NONE, _NO_NUMBERS = np.zeros(0), np.zeros(0, int)
_NO_ECHOES = Echoes(
    sweep=_NO_NUMBERS,
    x_m=_NONE,
    y_m=_NONE,
    axis_rad=_NONE,
    half_beam_rad=_NONE,
    range_m=_NONE,
    sigma_m=_NONE,
    calibrated=_NONE.astype(bool),
    sigma_position_m=_NONE,
    sigma_heading_rad=_NONE,
    step_rad=_NONE,
    unit=_NO_NUMBERS,
    heading_rad=_NONE,
    sigma_bias_m=_NONE,
    sigma_scale=_NONE,
    face_offset_m=_NONE,
    sigma_face_m=_NONE,
    sense=_NO_NUMBERS,
)
