"""What units whose poses are known hear of a room together: walls and points, each with what is known of it.

One place cannot tell a wall from a point (a corner, a post), so a landmark heard from one place only is both.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped


@dataclass(frozen=True, eq=False)  # of arrays
class PlacedUnit:
    """A unit's view and its pose (x_m, y_m, heading_rad) with the pose's covariance (3, 3)."""

    view: UnitView
    pose: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class Landmarks:
    """Walls (w,) on the lines x cos(alpha) + y sin(alpha) = rho, known from ``low_m`` to ``high_m`` along the tangent;
    and points (p, 2). ``group`` (w + p,) is the number of each landmark's group of plateaus, walls first; ``heard_by``
    (w + p,) how many units heard each.
    """

    alpha_rad: np.ndarray
    rho_m: np.ndarray
    wall_covariance: np.ndarray  # (w, 2, 2) of (alpha, rho)
    low_m: np.ndarray
    high_m: np.ndarray
    point_m: np.ndarray
    point_covariance: np.ndarray  # (p, 2, 2)
    group: np.ndarray
    heard_by: np.ndarray


Members = tuple[tuple[int, int], ...]  # (unit's number, plateau's number) of what one reflector made


@dataclass(frozen=True)
class Models:
    """Groups of plateaus (g,) as walls (alpha, rho) or as points (x, y): values (g, 2), covariances (g, 2, 2), and how
    ill the plateaus fit: chi-square over its degrees of freedom, 0 where there are none.
    """

    value: np.ndarray
    covariance: np.ndarray
    misfit: np.ndarray


@dataclass(frozen=True)
class Rows:
    """Plateaus (n,) in the site's frame, the pose's own error in their sigmas, and the number of each one's group."""

    group: np.ndarray
    place_m: np.ndarray
    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray


def landmarks_of(units: Sequence[PlacedUnit], groups: Sequence[Members]) -> Landmarks:
    """The landmarks whose plateaus are ``groups``."""
    rows = rows_of(units, groups)
    walls, points = wall_models(rows), point_models(rows)
    as_wall = np.nonzero((walls.misfit <= _MOST_MISFIT) | (walls.misfit <= points.misfit))[0]
    as_point = np.nonzero((points.misfit <= _MOST_MISFIT) | (points.misfit < walls.misfit))[0]
    alpha_rad, rho_m = walls.value[as_wall].T
    low_m, high_m = _extents(rows, walls)
    return Landmarks(
        alpha_rad=alpha_rad,
        rho_m=rho_m,
        wall_covariance=walls.covariance[as_wall],
        low_m=low_m[as_wall],
        high_m=high_m[as_wall],
        point_m=points.value[as_point],
        point_covariance=points.covariance[as_point],
        group=np.concatenate([as_wall, as_point]),
        heard_by=np.bincount(rows.group, minlength=len(groups))[np.concatenate([as_wall, as_point])],
    )


_MOST_MISFIT = 4.0


def rows_of(units: Sequence[PlacedUnit], groups: Sequence[Members]) -> Rows:
    """The plateaus of the groups in a row."""
    unit = np.array([number for group in groups for number, _ in group], dtype=int)
    first = np.cumsum([0, *(len(one.view) for one in units)])
    row = first[unit] + np.array([plateau for group in groups for _, plateau in group], dtype=int)
    pose = np.array([one.pose for one in units])[unit].reshape(-1, 3)
    covariance = np.array([one.covariance for one in units])[unit].reshape(-1, 3, 3)
    direction_rad = pose[:, 2] + _all(one.view.direction_rad for one in units)[row]
    normal = _unit(direction_rad)
    along_m2 = np.einsum("ni,nij,nj->n", normal, covariance[:, :2, :2], normal)
    sigma_rad = _all(one.view.direction_sigma_rad for one in units)[row]
    return Rows(
        group=np.repeat(np.arange(len(groups)), [len(group) for group in groups]),
        place_m=pose[:, :2],
        direction_rad=direction_rad,
        direction_sigma_rad=np.sqrt(sigma_rad**2 + covariance[:, 2, 2]),
        range_m=_all(one.view.range_m for one in units)[row],
        range_sigma_m=np.sqrt(_all(one.view.range_sigma_m for one in units)[row] ** 2 + along_m2),
    )


def wall_models(rows: Rows) -> Models:
    """The walls on which the plateaus of each group lie best."""
    first = np.searchsorted(rows.group, np.arange(rows.group.max(initial=-1) + 1))
    value = np.stack([rows.direction_rad[first], np.zeros(len(first))], axis=1)
    value[:, 1] = rows.range_m[first] + (rows.place_m[first] * _unit(value[:, 0])).sum(axis=1)

    def residuals(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        normal = _unit(at[:, 0])
        along_m = rows.place_m[:, 1] * normal[:, 0] - rows.place_m[:, 0] * normal[:, 1]
        one = np.ones(len(at))
        return (
            wrapped(rows.direction_rad - at[:, 0]),
            np.stack([-one, 0 * one], axis=1),
            rows.range_m + (rows.place_m * normal).sum(axis=1) - at[:, 1],
            np.stack([along_m, -one], axis=1),
        )

    return _fitted(rows, value, residuals)


def point_models(rows: Rows) -> Models:
    """The points at which the plateaus of each group were heard best."""
    heard_m = rows.place_m + rows.range_m[:, None] * _unit(rows.direction_rad)
    count = np.bincount(rows.group)
    value = np.stack([np.bincount(rows.group, weights) / count for weights in heard_m.T], axis=1)

    def residuals(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        way = at - rows.place_m
        range_m = np.maximum(np.hypot(*way.T), _NEAR_M)
        towards = way / range_m[:, None]
        across = np.stack([-towards[:, 1], towards[:, 0]], axis=1)
        off_rad = wrapped(rows.direction_rad - np.arctan2(way[:, 1], way[:, 0]))
        return off_rad, -across / range_m[:, None], rows.range_m - range_m, -towards

    return _fitted(rows, value, residuals)


# Of the groups' values (g, 2) at each plateau: errors of direction and of range, each with its slopes (n, 2).
_Residuals = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
_STEPS = 4
_NEAR_M = 0.02


def _fitted(rows: Rows, value: np.ndarray, residuals: _Residuals) -> Models:
    """Gauss-Newton of all groups side by side, from ``value`` (g, 2)."""
    weight_rad, weight_m = rows.direction_sigma_rad**-2, rows.range_sigma_m**-2
    covariance, square = np.zeros((len(value), 2, 2)), np.zeros(len(value))
    for _ in range(_STEPS):
        off_rad, slope_rad, off_m, slope_m = residuals(value[rows.group])
        information = _sums(rows.group, len(value), weight_rad, slope_rad, slope_rad)
        information += _sums(rows.group, len(value), weight_m, slope_m, slope_m)
        gradient = _sums(rows.group, len(value), weight_rad * off_rad, slope_rad, None)
        gradient += _sums(rows.group, len(value), weight_m * off_m, slope_m, None)
        covariance = np.linalg.inv(information)
        value = value - np.einsum("gij,gj->gi", covariance, gradient)
        square = np.bincount(rows.group, weight_rad * off_rad**2 + weight_m * off_m**2, len(value))
    free = 2 * np.bincount(rows.group, minlength=len(value)) - 2
    return Models(value, covariance, np.where(free > 0, square / np.maximum(free, 1), 0.0))


def _sums(
    group: np.ndarray, groups: int, weight: np.ndarray, first: np.ndarray, second: np.ndarray | None
) -> np.ndarray:
    """Sums by group of weight times first (n, 2), (g, 2), or times its outer product with second, (g, 2, 2)."""
    if second is None:
        return np.stack([np.bincount(group, weight * first[:, i], groups) for i in range(2)], axis=-1)
    rows = [[np.bincount(group, weight * first[:, i] * second[:, j], groups) for j in range(2)] for i in range(2)]
    return np.moveaxis(np.array(rows), -1, 0)


def _extents(rows: Rows, walls: Models) -> tuple[np.ndarray, np.ndarray]:
    """From where to where along its tangent each wall was touched, (g,)."""
    tangent = _unit(walls.value[rows.group, 0] + np.pi / 2)
    along_m = (rows.place_m * tangent).sum(axis=1)
    low_m, high_m = np.full(len(walls.value), np.inf), np.full(len(walls.value), -np.inf)
    np.minimum.at(low_m, rows.group, along_m)
    np.maximum.at(high_m, rows.group, along_m)
    return low_m, high_m


def _all(arrays: Iterable[np.ndarray]) -> np.ndarray:
    return np.fromiter(chain.from_iterable(arrays), dtype=float)


def _unit(angle_rad: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
