"""Poses of one unit in the frame of another at which two things that both hear agree.

Two walls that are not parallel give heading and place; so does a wall with a point. Two walls that face each other
leave the place along them open: of those poses there is one every so far.
"""

import numpy as np

from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped

_GATE_SIGMAS = 3.5
_LEAST_SINE = 0.25  # of the angle between two walls that fix a place
_WIDTH_M = 0.03  # to which two widths of one corridor agree
_ALONG_M = np.arange(-5.0, 5.01, 0.25)
_ACROSS_M = 0.12  # by which a point's place may be off a wall's distance
_FARTHEST_M = 8.0  # two units that hear one reflector


def pair_poses(one: UnitView, other: UnitView) -> np.ndarray:
    """Poses (k, 3) of ``other`` in the frame of ``one``, many of them alike."""
    if len(one) < 2 or len(other) < 2:
        return np.zeros((0, 3))
    a, b, c, d = (each.ravel() for each in np.meshgrid(*map(np.arange, (len(one), len(one), len(other), len(other)))))
    distinct = (a != b) & (c != d)
    a, b, c, d = a[distinct], b[distinct], c[distinct], d[distinct]
    ways = (_by_two_walls, _by_wall_and_point, _along)
    poses = np.concatenate([way(one, other, a, b, c, d) for way in ways])
    return poses[np.hypot(*poses[:, :2].T) < _FARTHEST_M]


def _by_two_walls(
    one: UnitView, other: UnitView, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray
) -> np.ndarray:
    sine = np.sin(one.direction_rad[b] - one.direction_rad[a])
    fits = (a < b) & (np.abs(sine) > _LEAST_SINE) & _angles_agree(one, other, a, b, c, d)
    a, b, c, d, sine = a[fits], b[fits], c[fits], d[fits], sine[fits]
    first_m, second_m = one.range_m[a] - other.range_m[c], one.range_m[b] - other.range_m[d]
    alpha, beta = one.direction_rad[a], one.direction_rad[b]
    x_m = (first_m * np.sin(beta) - second_m * np.sin(alpha)) / sine
    y_m = (second_m * np.cos(alpha) - first_m * np.cos(beta)) / sine
    return np.stack([x_m, y_m, _heading(one, other, a, b, c, d)], axis=1)


def _by_wall_and_point(
    one: UnitView, other: UnitView, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray
) -> np.ndarray:
    heading_rad = one.direction_rad[a] - other.direction_rad[c]
    place_m = one.range_m[b, None] * _unit(one.direction_rad[b])
    place_m = place_m - other.range_m[d, None] * _unit(heading_rad + other.direction_rad[d])
    wall_m = one.range_m[a] - other.range_m[c]
    off_m = (place_m * _unit(one.direction_rad[a])).sum(axis=1) - wall_m
    fits = np.abs(off_m) < _ACROSS_M
    return np.concatenate([place_m, heading_rad[:, None]], axis=1)[fits]


def _along(one: UnitView, other: UnitView, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    facing = np.cos(one.direction_rad[b] - one.direction_rad[a]) < -np.sqrt(1 - _LEAST_SINE**2)
    width_m = one.range_m[a] + one.range_m[b] - other.range_m[c] - other.range_m[d]
    fits = (a < b) & facing & _angles_agree(one, other, a, b, c, d) & (np.abs(width_m) < _WIDTH_M)
    a, b, c, d = a[fits], b[fits], c[fits], d[fits]
    normal = _unit(one.direction_rad[a])
    tangent = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    place_m = ((one.range_m[a] - other.range_m[c])[:, None] * normal)[:, None] + _ALONG_M[:, None] * tangent[:, None]
    heading_rad = np.broadcast_to(_heading(one, other, a, b, c, d)[:, None, None], (*place_m.shape[:2], 1))
    return np.concatenate([place_m, heading_rad], axis=2).reshape(-1, 3)


def _angles_agree(
    one: UnitView, other: UnitView, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray
) -> np.ndarray:
    off_rad = wrapped(one.direction_rad[b] - one.direction_rad[a] - other.direction_rad[d] + other.direction_rad[c])
    rad2 = one.direction_sigma_rad[a] ** 2 + one.direction_sigma_rad[b] ** 2
    rad2 = rad2 + other.direction_sigma_rad[c] ** 2 + other.direction_sigma_rad[d] ** 2
    return off_rad**2 < _GATE_SIGMAS**2 * rad2


def _heading(one: UnitView, other: UnitView, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """The mean of what both walls say."""
    first_rad = one.direction_rad[a] - other.direction_rad[c]
    return wrapped(first_rad + 0.5 * wrapped(one.direction_rad[b] - other.direction_rad[d] - first_rad))


def _unit(angle_rad: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
