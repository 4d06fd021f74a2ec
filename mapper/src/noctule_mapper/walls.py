"""Walls from feature points: Hough transform, extended Hough transform, least squares (Liu et al. 2019, Section
IV.A-C).
"""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import WallConfig
from noctule_mapper.features import FeaturePoints
from noctule_mapper.reflectors import Line


@dataclass(frozen=True)
class FittedWall:
    """A wall, the covariance of its (theta, rho), (2, 2), and the numbers of its feature points."""

    line: Line
    covariance: np.ndarray
    members: np.ndarray


def hough_peak(x_m: np.ndarray, y_m: np.ndarray, config: WallConfig) -> tuple[float, float, int]:
    """The line (theta_rad, rho_m) that most of the points (n,) vote for, Eq. 9, and its votes; n of at least 1."""
    theta = np.arange(0, np.pi, config.theta_bin_rad)
    rho = np.outer(x_m, np.cos(theta)) + np.outer(y_m, np.sin(theta))
    lowest = np.floor(rho.min() / config.rho_bin_m)
    bins = np.rint(rho / config.rho_bin_m - lowest).astype(int)
    accumulator = np.zeros((len(theta), bins.max() + 1), int)
    np.add.at(accumulator, (np.broadcast_to(np.arange(len(theta)), bins.shape), bins), 1)
    row, column = np.unravel_index(accumulator.argmax(), accumulator.shape)
    return float(theta[row]), float((column + lowest) * config.rho_bin_m), int(accumulator[row, column])


def orthogonal_line(x_m: np.ndarray, y_m: np.ndarray) -> tuple[float, float]:
    """The line (theta_rad, rho_m) with the least squared distances to the points (n,), n of at least 2.

    In place of Eq. 10-14, which minimise along y and so fail on walls parallel to it.
    """
    cx, cy = x_m.mean(), y_m.mean()
    u, v = x_m - cx, y_m - cy
    theta = 0.5 * np.arctan2(2 * (u * v).sum(), (u * u).sum() - (v * v).sum()) + np.pi / 2
    return float(theta), float(cx * np.cos(theta) + cy * np.sin(theta))


def extended_hough(points: FeaturePoints, sigma_m: float, config: WallConfig) -> list[FittedWall]:
    """Walls one by one: the highest peak, the points that deviate little from it, their least-squares line; then
    without them the next.

    The deviation test is Eq. 15 with rho_max in it, |x cos + y sin - rho_max| <= k sigma; it is made once more about
    the fitted line, for a peak is only as good as its bins.
    """
    left = np.arange(len(points.x_m))
    walls = []
    while len(left) >= config.least_points:
        x, y = points.x_m[left], points.y_m[left]
        theta, rho, _ = hough_peak(x, y, config)
        near = np.ones(len(left), bool)
        for tolerance_m in (config.deviation_sigmas * sigma_m + config.rho_bin_m, config.deviation_sigmas * sigma_m):
            near = np.abs(x * np.cos(theta) + y * np.sin(theta) - rho) <= tolerance_m
            if near.sum() < config.least_points:
                return walls
            theta, rho = orthogonal_line(x[near], y[near])
        walls.append(_fitted(points, left[near], theta, rho, sigma_m))
        left = left[~near]
    return walls


def _fitted(points: FeaturePoints, members: np.ndarray, theta: float, rho: float, sigma_m: float) -> FittedWall:
    """The wall on the line, its normal turned away from where it was heard, from its first point to its last."""
    if np.cos(points.direction_rad[members] - theta).sum() < 0:
        theta, rho = theta + np.pi, -rho
    theta = float(np.arctan2(np.sin(theta), np.cos(theta)))
    line = Line(theta, rho)
    along = points.x_m[members] * line.tangent[0] + points.y_m[members] * line.tangent[1]
    slopes = np.stack([-along, np.ones(len(along))], axis=1)
    covariance = sigma_m**2 * np.linalg.inv(slopes.T @ slopes)
    return FittedWall(Line(theta, rho, float(along.min()), float(along.max())), covariance, members)
