"""Echoes: the readings of many sweeps that heard something, as flat arrays."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

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

    def __len__(self) -> int:
        return len(self.range_m)

    def take(self, index: np.ndarray) -> "Echoes":
        """The echoes at ``index`` (numbers or a mask)."""
        return Echoes(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})


def echoes_of(sweep: SweepReadings, number: int, assumed_sigma_m: float) -> Echoes:
    """The echoes of one sweep, numbered ``number``; ``assumed_sigma_m`` stands in for a sensor not calibrated."""
    heard = np.isfinite(sweep.range_m)
    alike = np.ones(int(heard.sum()))
    return Echoes(
        sweep=np.full(len(alike), number),
        x_m=alike * sweep.x_m,
        y_m=alike * sweep.y_m,
        axis_rad=sweep.direction_rad[heard],
        half_beam_rad=alike * sweep.beam_width_rad / 2,
        range_m=sweep.range_m[heard],
        sigma_m=alike * (sweep.range_sigma_m or assumed_sigma_m),
        calibrated=np.full(len(alike), sweep.range_sigma_m is not None),
        sigma_position_m=alike * sweep.sigma_position_m,
        sigma_heading_rad=alike * sweep.sigma_heading_rad,
    )


def join(parts: Sequence[Echoes]) -> Echoes:
    """Several sets of echoes as one, in their order."""
    if not parts:
        none = np.zeros(0)
        return Echoes(none.astype(int), none, none, none, none, none, none, none.astype(bool), none, none)
    return Echoes(
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in Echoes.__dataclass_fields__}
    )
