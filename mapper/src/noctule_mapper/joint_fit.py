"""The joint fit: all objects at once to the raw ranges, robust least squares with each place's error as a covariance.

An error of a place moves all ranges from there together, be they of one sweep or of many by a unit that stands still:
their covariance is sigma^2 I + s^2 N N^T, N the directions (Section "Refinement" of this package's README). Echoes far
off, by Tukey's weight, count less and then not at all.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.likelihood import Evidence
from noctule_mapper.reflectors import Crossing, Line, Reflector

_TUKEY_SIGMAS = 4.685  # 95 % efficient on Gaussian errors
_WEAK_PRIOR = 1e-9  # keeps what no echo determines where it is


@dataclass(frozen=True)
class Link:
    """Wall ``first`` ends where wall ``second`` starts: indices into the objects."""

    first: int
    second: int


def crossing(objects: Sequence[Reflector], link: Link) -> Crossing:
    """The corner of two linked walls."""
    first, second = objects[link.first], objects[link.second]
    if not isinstance(first, Line) or not isinstance(second, Line):
        raise TypeError(f"{link} joins {first} and {second}; only walls have ends to join")
    return Crossing(first, second)


@dataclass(frozen=True)
class Fit:
    """The objects after the fit, and the covariance of all their parameters, those of object i from offsets[i] on."""

    objects: list[Reflector]
    covariance: np.ndarray
    offsets: np.ndarray

    def covariance_of(self, *indices: int) -> np.ndarray:
        """Joint covariance of the parameters of some objects."""
        rows = np.concatenate([np.arange(self.offsets[i], self.offsets[i + 1]) for i in indices])
        return self.covariance[np.ix_(rows, rows)]


def joint_fit(
    objects: Sequence[Reflector], links: Sequence[Link], made_by: np.ndarray, data: Evidence, iterations: int = 3
) -> Fit:
    """Fit ``objects`` and, through their walls, ``links``; ``made_by`` (n,) numbers objects and then links, -1 for no
    maker.
    """
    objects = list(objects)
    offsets = np.concatenate([[0], np.cumsum([len(one.parameters) for one in objects])]).astype(int)
    information = _WEAK_PRIOR * np.eye(offsets[-1])
    explained = np.nonzero(made_by >= 0)[0]
    used, makers = data.take(explained), made_by[explained]
    for _ in range(iterations):
        slopes, residual, direction = _linearise(objects, links, makers, used, offsets)
        slopes, residual = _whiten(slopes, residual, direction, used)
        robust = np.maximum(1 - (residual / _TUKEY_SIGMAS) ** 2, 0) ** 2
        information = slopes.T @ (robust[:, None] * slopes) + _WEAK_PRIOR * np.eye(offsets[-1])
        step = np.linalg.solve(information, slopes.T @ (robust * residual))
        objects = [one.moved(step[offsets[i] : offsets[i + 1]]) for i, one in enumerate(objects)]
    return Fit(objects, np.linalg.inv(information), offsets)


def _linearise(
    objects: Sequence[Reflector], links: Sequence[Link], makers: np.ndarray, used: Evidence, offsets: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes (n, parameters), residuals (n,) and directions (n,) of the used echoes."""
    slopes = np.zeros((len(makers), offsets[-1]))
    residual, direction = np.zeros(len(makers)), np.zeros(len(makers))
    for maker in np.unique(makers):
        rows = np.nonzero(makers == maker)[0]
        if maker < len(objects):
            model, owners = objects[maker], (maker,)
        else:
            link = links[maker - len(objects)]
            model, owners = crossing(objects, link), (link.first, link.second)
        columns = np.concatenate([np.arange(int(offsets[i]), int(offsets[i + 1])) for i in owners])
        echoes = used.echoes.take(rows)
        slopes[np.ix_(rows, columns)] = model.slopes(echoes)
        residual[rows] = echoes.range_m - model.ranges(echoes)
        direction[rows] = model.directions(echoes)
    return slopes, residual, direction


def _whiten(
    slopes: np.ndarray, residual: np.ndarray, direction: np.ndarray, used: Evidence
) -> tuple[np.ndarray, np.ndarray]:
    """Slopes and residuals in standard deviations, and independent of one another.

    With I + A A^T the covariance of the ranges from a place, each over its own sigma, and A = U diag(s) V^T, the root
    of its inverse is I + U diag(1 / sqrt(1 + s^2) - 1) U^T: linear in the number of echoes.
    """
    pose_sigma = used.echoes.sigma_position_m
    range_sigma = np.sqrt(np.maximum(used.sigma_m**2 - pose_sigma**2, 1e-12))
    white_slopes, white_residual = slopes / range_sigma[:, None], residual / range_sigma
    uncertain = np.nonzero(pose_sigma > 0)[0]
    for rows in _by_place(used.echoes.x_m, used.echoes.y_m, uncertain):
        away = np.stack([np.cos(direction[rows]), np.sin(direction[rows])], axis=1)
        u, s, _ = np.linalg.svd(away * (pose_sigma[rows] / range_sigma[rows])[:, None], full_matrices=False)
        shrink = 1 / np.sqrt(1 + s**2) - 1
        white_slopes[rows] += u @ (shrink[:, None] * (u.T @ white_slopes[rows]))
        white_residual[rows] += u @ (shrink * (u.T @ white_residual[rows]))
    return white_slopes, white_residual


def _by_place(x_m: np.ndarray, y_m: np.ndarray, rows: np.ndarray) -> list[np.ndarray]:
    """The rows, split into those of the very same place."""
    if not len(rows):
        return []
    order = rows[np.lexsort((y_m[rows], x_m[rows]))]
    moved = (np.diff(x_m[order]) != 0) | (np.diff(y_m[order]) != 0)
    return np.split(order, np.nonzero(moved)[0] + 1)
