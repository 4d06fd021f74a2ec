"""What units whose poses are known hear of a room together: walls and points, each with what is known of it.

One place cannot tell a wall from a point (a corner, a post), so a landmark heard from one place only is both.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped


@dataclass(frozen=True, eq=False)  # of arrays
class PlacedUnit:
    """A unit's view and its pose (x_m, y_m, heading_rad) with the pose's covariance (3, 3)."""

    view: UnitView
    pose: np.ndarray
    covariance: np.ndarray

    @property
    def feet_m(self) -> np.ndarray:
        """Where its plateaus' reflectors were touched, (n, 2)."""
        direction_rad = self.pose[2] + self.view.direction_rad
        return self.pose[:2] + self.view.range_m[:, None] * np.stack([np.cos(direction_rad), np.sin(direction_rad)], 1)


@dataclass(frozen=True)
class Landmarks:
    """Walls (w,) on the lines x cos(alpha) + y sin(alpha) = rho, known from ``low_m`` to ``high_m`` along the tangent;
    and points (p, 2). ``members`` are the plateaus of each landmark, (unit's number, plateau's number), walls first.
    """

    alpha_rad: np.ndarray
    rho_m: np.ndarray
    wall_covariance: np.ndarray  # (w, 2, 2) of (alpha, rho)
    low_m: np.ndarray
    high_m: np.ndarray
    point_m: np.ndarray
    point_covariance: np.ndarray  # (p, 2, 2)
    members: tuple[tuple[tuple[int, int], ...], ...]


Members = list[tuple[int, int]]


@dataclass(frozen=True)
class Model:
    """A landmark as a wall (alpha, rho) or as a point (x, y), with its covariance and how ill its plateaus fit."""

    value: np.ndarray
    covariance: np.ndarray
    misfit: float  # chi-square over its degrees of freedom, 0 where there are none


def landmarks_of(units: Sequence[PlacedUnit], groups: Sequence[Members]) -> Landmarks:
    """The landmarks whose plateaus are ``groups``."""
    walls: list[tuple[Model, Members]] = []
    points: list[tuple[Model, Members]] = []
    for group in groups:
        wall, point = wall_model(units, group), point_model(units, group)
        if wall.misfit <= _MOST_MISFIT or wall.misfit <= point.misfit:
            walls.append((wall, group))
        if point.misfit <= _MOST_MISFIT or point.misfit < wall.misfit:
            points.append((point, group))
    extents = [_extent(units, model, group) for model, group in walls]
    return Landmarks(
        alpha_rad=np.array([model.value[0] for model, _ in walls]),
        rho_m=np.array([model.value[1] for model, _ in walls]),
        wall_covariance=np.array([model.covariance for model, _ in walls]).reshape(-1, 2, 2),
        low_m=np.array([low for low, _ in extents]),
        high_m=np.array([high for _, high in extents]),
        point_m=np.array([model.value for model, _ in points]).reshape(-1, 2),
        point_covariance=np.array([model.covariance for model, _ in points]).reshape(-1, 2, 2),
        members=tuple(tuple(group) for _, group in (*walls, *points)),
    )


_MOST_MISFIT = 4.0


def wall_model(units: Sequence[PlacedUnit], group: Members) -> Model:
    """The wall on which the plateaus of ``group`` lie best."""
    seen = _seen(units, group)
    value = np.array([seen.direction_rad[0], 0.0])
    value[1] = seen.range_m[0] + seen.place_m[0] @ _unit(value[0])
    for _ in range(_STEPS):
        normal, tangent = _unit(value[0]), _unit(value[0] + np.pi / 2)
        residual = np.stack(
            [
                wrapped(seen.direction_rad - value[0]) / seen.direction_sigma_rad,
                (seen.range_m + seen.place_m @ normal - value[1]) / seen.range_sigma_m,
            ]
        )
        slopes = np.stack(
            [
                np.stack([-1 / seen.direction_sigma_rad, 0 * seen.range_m], 1),
                np.stack([seen.place_m @ tangent / seen.range_sigma_m, -1 / seen.range_sigma_m], 1),
            ]
        )
        value, covariance = _step(value, residual, slopes)
    return Model(value, covariance, _misfit(residual))


def point_model(units: Sequence[PlacedUnit], group: Members) -> Model:
    """The point at which the plateaus of ``group`` were heard best."""
    seen = _seen(units, group)
    value = np.mean(
        seen.place_m + seen.range_m[:, None] * np.stack([np.cos(seen.direction_rad), np.sin(seen.direction_rad)], 1),
        axis=0,
    )
    for _ in range(_STEPS):
        way = value - seen.place_m
        range_m = np.maximum(np.hypot(*way.T), _NEAR_M)
        towards = way / range_m[:, None]
        across = np.stack([-towards[:, 1], towards[:, 0]], axis=1)
        bearing_rad = np.arctan2(way[:, 1], way[:, 0])
        residual = np.stack(
            [
                wrapped(seen.direction_rad - bearing_rad) / seen.direction_sigma_rad,
                (seen.range_m - range_m) / seen.range_sigma_m,
            ]
        )
        slopes = np.stack(
            [
                -across / (range_m * seen.direction_sigma_rad)[:, None],
                -towards / seen.range_sigma_m[:, None],
            ]
        )
        value, covariance = _step(value, residual, slopes)
    return Model(value, covariance, _misfit(residual))


_STEPS = 4
_NEAR_M = 0.02


@dataclass(frozen=True)
class _Seen:
    """Plateaus in the site's frame, (n,), the pose's own error in their sigmas."""

    place_m: np.ndarray
    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray


def _seen(units: Sequence[PlacedUnit], group: Members) -> _Seen:
    rows = [(units[unit], plateau) for unit, plateau in group]
    direction_rad = np.array([one.pose[2] + one.view.direction_rad[at] for one, at in rows])
    normals = np.stack([np.cos(direction_rad), np.sin(direction_rad)], axis=1)
    along_m2 = np.array([n @ one.covariance[:2, :2] @ n for n, (one, _) in zip(normals, rows, strict=True)])
    return _Seen(
        place_m=np.array([one.pose[:2] for one, _ in rows]),
        direction_rad=direction_rad,
        direction_sigma_rad=np.array(
            [np.hypot(one.view.direction_sigma_rad[at], np.sqrt(one.covariance[2, 2])) for one, at in rows]
        ),
        range_m=np.array([one.view.range_m[at] for one, at in rows]),
        range_sigma_m=np.sqrt(np.array([one.view.range_sigma_m[at] ** 2 for one, at in rows]) + along_m2),
    )


def _step(value: np.ndarray, residual: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One Gauss-Newton step; the value (2,) and its covariance (2, 2)."""
    rows, errors = slopes.reshape(-1, 2), residual.ravel()
    covariance = np.linalg.inv(rows.T @ rows)
    return value - covariance @ rows.T @ errors, covariance


def _misfit(residual: np.ndarray) -> float:
    free = residual.size - 2
    return float((residual**2).sum() / free) if free else 0.0


def _extent(units: Sequence[PlacedUnit], wall: Model, group: Members) -> tuple[float, float]:
    """From where to where along its tangent the wall was touched."""
    along_m = [units[unit].pose[:2] @ _unit(wall.value[0] + np.pi / 2) for unit, _ in group]
    return float(min(along_m)), float(max(along_m))


def _unit(angle_rad: float) -> np.ndarray:
    return np.array([np.cos(angle_rad), np.sin(angle_rad)])
