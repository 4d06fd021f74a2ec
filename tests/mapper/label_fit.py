"""The joint fit that is told what made every echo: the yardstick of accuracy.

Least squares on the raw ranges, by Gauss-Newton from the truth. It shares no code with the mapper's own joint fit: its
slopes are complex-step derivatives of the predicted ranges.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mapper.room import Label, LabelledSweep, Room

STEP = 1e-20  # imaginary: a complex step has no difference to round off
ITERATIONS = 4
WEAK_PRIOR = 1e-3  # per square metre or radian: keeps what no echo determines near the truth; it is reported as NaN
LEAST_WALL_ECHOES, LEAST_CYLINDER_ECHOES = 2, 3  # of its own, for one to be reported


@dataclass(frozen=True)
class LabelFit:
    """Walls (n, 2) as (theta, rho), normal out of the room; corners and edges (n, 2); cylinders (m, 3) as (x, y, r);
    and their covariances (n, 2, 2), (n, 2, 2) and (m, 3, 3). NaN where the echoes do not determine one.
    """

    walls: np.ndarray
    wall_covariances: np.ndarray
    corners: np.ndarray
    corner_covariances: np.ndarray
    cylinders: np.ndarray
    cylinder_covariances: np.ndarray


@dataclass(frozen=True)
class Heard:
    """The echoes of known make, arrays (n,): of walls, of corners and edges, of cylinders, each with its number."""

    x_m: np.ndarray
    y_m: np.ndarray
    range_m: np.ndarray
    sigma_m: np.ndarray
    sigma_position_m: np.ndarray
    by_wall: np.ndarray
    by_corner: np.ndarray
    by_cylinder: np.ndarray
    number: np.ndarray


def label_fit(room: Room, surveyed: Sequence[LabelledSweep]) -> LabelFit:
    """The best estimate of ``room`` from its echoes; false echoes are left out, late ones are not told apart."""
    heard = heard_of(surveyed)
    acute = room.interior_rad < np.pi / 2
    truth = parameters = parameters_of(room)
    information = np.eye(len(truth))
    for _ in range(ITERATIONS):
        slopes, residual = _whitened(parameters, acute, heard)
        information = slopes.T @ slopes + WEAK_PRIOR * np.eye(len(truth))
        step = np.linalg.solve(information, slopes.T @ residual + WEAK_PRIOR * (truth - parameters))
        parameters = parameters + step
    return reported(parameters, np.linalg.inv(information), len(acute), heard)


def on_time(surveyed: Sequence[LabelledSweep]) -> list[LabelledSweep]:
    """The survey without its late cycles: for a fit that is told also which echoes were late."""
    return [
        replace(one, sweep=replace(one.sweep, range_m=one.sweep.range_m - one.late_m), late_m=np.zeros_like(one.late_m))
        for one in surveyed
    ]


def variances(covariances: np.ndarray) -> np.ndarray:
    """The diagonals of (n, k, k), (n, k)."""
    return np.diagonal(covariances, axis1=1, axis2=2)


def wall_lines(room: Room) -> np.ndarray:
    """The true walls as (theta, rho), normal out of the room, (n, 2)."""
    along = room.ends - room.vertices
    theta = np.arctan2(-along[:, 0], along[:, 1])
    return np.stack([theta, room.vertices[:, 0] * np.cos(theta) + room.vertices[:, 1] * np.sin(theta)], axis=1)


def parameters_of(room: Room) -> np.ndarray:
    return np.concatenate([wall_lines(room).ravel(), np.array(room.cylinders).ravel()])


def heard_of(surveyed: Sequence[LabelledSweep]) -> Heard:
    known: list[tuple[LabelledSweep, int, Label]] = [
        (one, i, label)
        for one in surveyed
        for i, label in enumerate(one.labels)
        if label.index >= 0 and np.isfinite(one.sweep.range_m[i])
    ]
    kinds = np.array([label.kind for _, _, label in known])
    return Heard(
        x_m=np.array([one.sweep.x_m for one, _, _ in known]),
        y_m=np.array([one.sweep.y_m for one, _, _ in known]),
        range_m=np.array([one.sweep.range_m[i] for one, i, _ in known]),
        sigma_m=np.array([one.sigma_m for one, _, _ in known]),
        sigma_position_m=np.array([one.sweep.sigma_position_m for one, _, _ in known]),
        by_wall=kinds == "wall",
        by_corner=(kinds == "corner") | (kinds == "edge"),
        by_cylinder=kinds == "cylinder",
        number=np.array([label.index for _, _, label in known], dtype=int),
    )


def corner_points(parameters: np.ndarray, corners: int) -> np.ndarray:
    """Where wall i - 1 and wall i cross, (n, 2)."""
    theta, rho = parameters[: 2 * corners].reshape(-1, 2).T
    before, rho_before = np.roll(theta, 1), np.roll(rho, 1)
    sine = np.sin(theta - before)
    x = (rho_before * np.sin(theta) - rho * np.sin(before)) / sine
    y = (rho * np.cos(before) - rho_before * np.cos(theta)) / sine
    return np.stack([x, y], axis=1)


def predicted(parameters: np.ndarray, place: np.ndarray, acute: np.ndarray, heard: Heard) -> np.ndarray:
    """Ranges (n,) from ``place`` (2, n).

    Wall R = rho - n . p, corner R = |c - p| k with k = sin(a) for an interior angle a < 90 degrees, else 1, cylinder
    R = |c - p| - r.
    """
    walls = parameters[: 2 * len(acute)].reshape(-1, 2)
    cylinders = parameters[2 * len(acute) :].reshape(-1, 3)
    ranges = np.zeros(len(heard.range_m), dtype=complex)
    on, who = heard.by_wall, heard.number[heard.by_wall]
    theta, rho = walls[who].T
    ranges[on] = rho - np.cos(theta) * place[0, on] - np.sin(theta) * place[1, on]
    on, who = heard.by_corner, heard.number[heard.by_corner]
    factor = np.where(acute[who], np.sin(walls[who, 0] - walls[who - 1, 0]), 1.0)
    ranges[on] = factor * distance(corner_points(parameters, len(acute))[who].T, place[:, on])
    on, who = heard.by_cylinder, heard.number[heard.by_cylinder]
    ranges[on] = distance(cylinders[who, :2].T, place[:, on]) - cylinders[who, 2]
    return ranges


def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Between points (2, n); np.hypot takes no complex numbers."""
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2)


def slopes_of(function: Callable[[np.ndarray], np.ndarray], parameters: np.ndarray) -> np.ndarray:
    """Derivatives of ``function`` (...,) by its parameters, (..., parameters)."""
    steps = 1j * STEP * np.eye(len(parameters))
    return np.stack([np.imag(function(parameters + step)) for step in steps], axis=-1) / STEP


def _whitened(parameters: np.ndarray, acute: np.ndarray, heard: Heard) -> tuple[np.ndarray, np.ndarray]:
    """Slopes (n, parameters) and residuals (n,), by the inverse root of each place's sigma^2 I + s^2 N N^T."""
    place = np.stack([heard.x_m, heard.y_m])
    slopes = slopes_of(lambda moved: predicted(moved, place, acute, heard), parameters)
    by_place = slopes_of(lambda moved: predicted(parameters, place + moved[:, None], acute, heard), np.zeros(2))
    residual = heard.range_m - np.real(predicted(parameters, place, acute, heard))
    _, visit = np.unique(place, axis=1, return_inverse=True)
    for number in np.unique(visit):
        rows = np.nonzero(visit.reshape(-1) == number)[0]
        covariance = np.diag(heard.sigma_m[rows] ** 2)
        covariance += heard.sigma_position_m[rows[0]] ** 2 * by_place[rows] @ by_place[rows].T
        root = np.linalg.cholesky(covariance)
        slopes[rows] = np.linalg.solve(root, slopes[rows])
        residual[rows] = np.linalg.solve(root, residual[rows])
    return slopes, residual


def reported(parameters: np.ndarray, covariance: np.ndarray, walls: int, heard: Heard) -> LabelFit:
    """The fitted parameters by kind, NaN where an object has too few echoes of its own."""
    cylinders = (len(parameters) - 2 * walls) // 3
    lonely = np.bincount(heard.number[heard.by_wall], minlength=walls) < LEAST_WALL_ECHOES
    adrift = lonely | np.roll(lonely, 1)
    unseen = np.bincount(heard.number[heard.by_cylinder], minlength=cylinders) < LEAST_CYLINDER_ECHOES
    slopes = slopes_of(lambda moved: corner_points(moved, walls), parameters)
    return LabelFit(
        walls=_but_not(lonely, parameters[: 2 * walls].reshape(-1, 2)),
        wall_covariances=_but_not(lonely, _blocks(covariance[: 2 * walls, : 2 * walls], 2)),
        corners=_but_not(adrift, corner_points(parameters, walls)),
        corner_covariances=_but_not(adrift, slopes @ covariance @ slopes.transpose(0, 2, 1)),
        cylinders=_but_not(unseen, parameters[2 * walls :].reshape(-1, 3)),
        cylinder_covariances=_but_not(unseen, _blocks(covariance[2 * walls :, 2 * walls :], 3)),
    )


def _blocks(covariance: np.ndarray, size: int) -> np.ndarray:
    """The square blocks on the diagonal, (n, size, size)."""
    firsts = range(0, len(covariance), size)
    return np.array([covariance[i : i + size, i : i + size] for i in firsts]).reshape(-1, size, size)


def _but_not(unknown: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.where(unknown.reshape(-1, *[1] * (values.ndim - 1)), np.nan, values)
