"""Tangency: the circles that two arcs share.

With s = 1 / (r + R_i) for the circle's curvature as reading i sees it, d = p_i - p_j, and n the direction from p_i to
the contact, tangency to both arcs is

    2 n . d + 2 (R_i - R_j) + s (|d|^2 - (R_i - R_j)^2) = 0

which for every s gives n up to a mirror image: a wall has s = 0, a point s = 1 / R_i.
"""

from typing import Literal

import numpy as np

from noctule_mapper.readings.pairs import Offsets

Side = Literal[1, -1]
SIDES: tuple[Side, Side] = (1, -1)


def turn_rad(between: Offsets, curvature_per_m: np.ndarray | float) -> np.ndarray:
    """The angle between d and n, 0 to pi, for circles of the given s; NaN where none touches both arcs. Of the shape
    that ``between`` and ``curvature_per_m`` have together.
    """
    baseline_m, longer_m = between.baseline_m, between.longer_m
    cosine = -(longer_m + curvature_per_m * (baseline_m**2 - longer_m**2) / 2) / baseline_m
    return np.arccos(np.where(np.abs(cosine) <= 1, cosine, np.nan))


def direction_rad(between: Offsets, turned_rad: np.ndarray, side: Side) -> np.ndarray:
    """The direction of n, on one side of d or the other."""
    return np.arctan2(between.dy_m, between.dx_m) + side * turned_rad


def other_direction_rad(between: Offsets, direction_rad: np.ndarray, curvature_per_m: np.ndarray | float) -> np.ndarray:
    """The direction from p_j to its own contact with the circle that reading i touches in ``direction_rad``: towards
    the centre, n + s d.
    """
    return np.arctan2(
        curvature_per_m * between.dy_m + np.sin(direction_rad), curvature_per_m * between.dx_m + np.cos(direction_rad)
    )
