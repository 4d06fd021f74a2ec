"""A planned path: the poses at which a unit that is carried along straight sides makes its sweeps."""

import math
from collections.abc import Sequence

# A side whose length is a whole number of steps must not gain one by rounding.
_STEP_TOLERANCE = 1e-9


def walk(corners_m: Sequence[tuple[float, float]], spacing_m: float, closed: bool) -> list[tuple[float, float, float]]:
    """The (x_m, y_m, heading_rad) along the sides between ``corners_m``; where ``closed`` the last side leads home.

    A side is walked in steps of ``spacing_m`` from its first corner, the last step shorter; the heading is along the
    side. A corner belongs to the side that begins there, and an open path's last corner to the side that ends there.
    Consecutive corners must differ.
    """
    ends = [*corners_m[1:], corners_m[0]] if closed else corners_m[1:]
    poses = [pose for start, end in zip(corners_m, ends, strict=False) for pose in _side(start, end, spacing_m)]
    if not closed:
        poses.append((*corners_m[-1], poses[-1][2]))
    return poses


def _side(start: tuple[float, float], end: tuple[float, float], spacing_m: float) -> list[tuple[float, float, float]]:
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length_m = math.hypot(along_x, along_y)
    heading_rad = math.atan2(along_y, along_x)
    steps = max(1, math.ceil(length_m / spacing_m - _STEP_TOLERANCE))
    fractions = [step * spacing_m / length_m for step in range(steps)]
    return [(start[0] + along_x * f, start[1] + along_y * f, heading_rad) for f in fractions]
