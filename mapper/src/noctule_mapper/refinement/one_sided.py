"""Cylinders that two units hear from one side.

Two ranges leave a cylinder's radius open, but two plateaus have directions too, and these cross at its axis. Two walls,
each heard by one of the units, answer so only if their ranges agree by chance on one radius, and if nobody looks past
what is not there. Before the walls are known many pairs do, so these cylinders are sought last.
"""

from collections.abc import Iterator

import numpy as np

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.reflectors import Circle
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.candidates import circles_of_pairs
from noctule_mapper.refinement.model_selection import determined

_STEPS = 4
_MOST_SQUARE = 9.0  # squared normalised errors of two ranges and two directions, one more than there are parameters
_ALONE = 2.0  # times as free as a reported one: all the readings will tell more than two plateaus do


def one_sided_cylinders(free: np.ndarray, data: Evidence, config: MapperConfig) -> Iterator[Circle]:
    """Cylinders that explain two of the ``free`` plateaus, bool (n,), of two places, and are known by them."""
    flat = data.take(free & np.isfinite(data.direction_sigma_rad))
    for pair, start in zip(*circles_of_pairs(flat, config.cylinders), strict=True):
        circle, covariance, square = _fitted(Circle(*(float(p) for p in start)), flat.take(pair))
        if square < _MOST_SQUARE and determined(circle, covariance, 2, data, config, _ALONE):
            yield circle


def _fitted(circle: Circle, heard: Evidence) -> tuple[Circle, np.ndarray, float]:
    """The circle fitted to the ranges and the directions of two plateaus, its covariance (3, 3) and the squared
    normalised errors that are left.
    """
    echoes = heard.echoes
    weight = 1 / np.concatenate([heard.sigma_m, heard.turn_sigma_rad])
    covariance, square = np.eye(3), np.inf
    for _ in range(_STEPS):
        turn_rad = wrapped(echoes.axis_rad - circle.directions(echoes))
        off = weight * np.concatenate([echoes.range_m - circle.ranges(echoes), turn_rad])
        slopes = weight[:, None] * np.concatenate([circle.slopes(echoes), circle.direction_slopes(echoes)])
        covariance = np.linalg.pinv(slopes.T @ slopes)
        step = covariance @ slopes.T @ off
        circle, square = circle.moved(step), float(((off - slopes @ step) ** 2).sum())
    return circle, covariance, square
