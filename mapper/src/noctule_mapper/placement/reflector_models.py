"""What kind of reflector made a group of plateaus, each heard by another unit: a wall, a corner or a post, by evidence.

A corner or post at c answers a unit at p at the range k |c - p| - r: a corner up to a right angle straight back (k = 1,
r = 0), an acute one by double bounce (k is the sine of its angle), a post by its radius r nearer.
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


Members = tuple[tuple[int, int], ...]  # (unit's number, plateau's number) of what one reflector made


@dataclass(frozen=True)
class Kind:
    """Reflectors of a kind: their share of what units hear in random rooms, and mean and sigma of k and of r."""

    share: float
    scale: tuple[float, float]
    radius_m: tuple[float, float]


NEW_SHARE = 0.2  # of plateaus are of reflectors that no other unit hears
_EXACT = 1e-4
WALL_SHARE = 0.47
POINT_KINDS = (
    Kind(0.33, (1.0, _EXACT), (0.0, _EXACT)),  # corners from a right angle on
    Kind(0.08, (0.9, 0.08), (0.0, _EXACT)),  # acute ones
    Kind(0.12, (1.0, _EXACT), (0.22, 0.12)),  # posts
)


@dataclass(frozen=True)
class Rows:
    """Plateaus (n,) in the site's frame, the pose's own error in their sigmas, and the number of each one's group."""

    group: np.ndarray
    place_m: np.ndarray
    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray


@dataclass(frozen=True)
class Models:
    """Groups of plateaus (g,) as reflectors of one kind: values (g, v), covariances (g, v, v), and the log of the
    kind's share times its evidence, (g,). Values are alpha and rho of a wall, x, y, k and r else.
    """

    value: np.ndarray
    covariance: np.ndarray
    log_evidence: np.ndarray


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


def all_models(rows: Rows) -> tuple[Models, ...]:
    """The groups as reflectors of each kind: walls, then points of each of ``POINT_KINDS``."""
    return wall_models(rows), *(point_models(rows, kind) for kind in POINT_KINDS)


def wall_models(rows: Rows) -> Models:
    """The walls on which the plateaus of each group lie best."""
    first = first_rows(rows)
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

    value, covariance, cost = _fitted(rows, value, residuals, np.zeros((2, 2)))
    evidence = np.log(WALL_SHARE) - cost + 0.5 * np.linalg.slogdet(covariance)[1]
    return Models(value, covariance, evidence)


def point_models(rows: Rows, kind: Kind) -> Models:
    """The corners or posts of a kind at which the plateaus of each group were heard best."""
    mean, sigma = np.array([kind.scale, kind.radius_m]).T
    away_m = (rows.range_m + mean[1]) / mean[0]
    heard_m = rows.place_m + away_m[:, None] * _unit(rows.direction_rad)
    count = np.bincount(rows.group)
    value = np.tile([0.0, 0.0, *mean], (len(count), 1))
    value[:, :2] = np.stack([np.bincount(rows.group, weights) / count for weights in heard_m.T], axis=1)

    def residuals(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        way = at[:, :2] - rows.place_m
        away_m = np.maximum(np.hypot(*way.T), NEAR_M)
        towards = way / away_m[:, None]
        across = np.stack([-towards[:, 1], towards[:, 0]], axis=1)
        none, one = np.zeros((len(at), 2)), np.ones(len(at))
        return (
            wrapped(rows.direction_rad - np.arctan2(way[:, 1], way[:, 0])),
            np.concatenate([-across / away_m[:, None], none], axis=1),
            rows.range_m - (at[:, 2] * away_m - at[:, 3]),
            np.column_stack([-at[:, 2, None] * towards, -away_m, one]),
        )

    known = np.diag([0.0, 0.0, *(sigma**-2)])
    value, covariance, cost = _fitted(rows, value, residuals, known, np.array([0.0, 0.0, *mean]))
    # A priori it lies anywhere in direction and range as first heard, like a wall: dx dy = d / k of these.
    first = first_rows(rows)
    away_m = np.maximum(np.hypot(*(value[:, :2] - rows.place_m[first]).T), NEAR_M)
    volume = (
        0.5 * np.linalg.slogdet(covariance)[1]
        - np.log(sigma).sum()
        - np.log(away_m / np.maximum(value[:, 2], LEAST_SCALE))
    )
    return Models(value, covariance, np.log(kind.share) - cost + volume)


# Of the groups' values (g, v) at each plateau: errors of direction and of range, each with its slopes (n, v).
_Residuals = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]
_STEPS = 5
SPAN_M = 4.0  # ranges of a new reflector lie anywhere in it
NEAR_M, LEAST_SCALE = 0.02, 0.1  # nothing is nearer to a unit, as far as divisions go
_ROBUST_SIGMAS = 2.0


def _fitted(
    rows: Rows, value: np.ndarray, residuals: _Residuals, known: np.ndarray, mean: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Robust Gauss-Newton of all groups side by side, from ``value`` (g, v), of which ``known`` (v, v) is the
    information about ``mean`` beforehand: values, covariances, and costs in nats.
    """
    mean = np.zeros(value.shape[1]) if mean is None else mean
    covariance, cost, starts = np.zeros((*value.shape, value.shape[1])), np.zeros(len(value)), first_rows(rows)
    for _ in range(_STEPS):
        off_rad, slope_rad, off_m, slope_m = residuals(value[rows.group])
        root_rad = np.sqrt(1 + (off_rad / rows.direction_sigma_rad / _ROBUST_SIGMAS) ** 2)
        root_m = np.sqrt(1 + (off_m / rows.range_sigma_m / _ROBUST_SIGMAS) ** 2)
        weight_rad, weight_m = rows.direction_sigma_rad**-2 / root_rad, rows.range_sigma_m**-2 / root_m
        information = known + _sums(starts, weight_rad, slope_rad, slope_rad)
        information += _sums(starts, weight_m, slope_m, slope_m)
        off = value - mean
        gradient = off @ known + _sums(starts, weight_rad * off_rad, slope_rad, None)
        gradient += _sums(starts, weight_m * off_m, slope_m, None)
        covariance = np.linalg.inv(information)
        value = value - np.einsum("gij,gj->gi", covariance, gradient)
        size = np.log(2 * np.pi * rows.direction_sigma_rad * rows.range_sigma_m)
        cost = np.bincount(rows.group, _ROBUST_SIGMAS**2 * (root_rad + root_m - 2) + size, len(value))
        cost = cost + 0.5 * np.einsum("gi,ij,gj->g", off, known, off)
    return value, covariance, cost


def first_rows(rows: Rows) -> np.ndarray:
    return np.searchsorted(rows.group, np.arange(rows.group.max(initial=-1) + 1))


def _sums(starts: np.ndarray, weight: np.ndarray, first: np.ndarray, second: np.ndarray | None) -> np.ndarray:
    """Sums by group of weight times first (n, v), (g, v), or times its outer product with second, (g, v, v)."""
    weighed = weight[:, None] * first
    each = weighed if second is None else weighed[:, :, None] * second[:, None, :]
    return np.add.reduceat(each, starts) if len(starts) else each[:0]


def _all(arrays: Iterable[np.ndarray]) -> np.ndarray:
    return np.fromiter(chain.from_iterable(arrays), dtype=float)


def _unit(angle_rad: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
