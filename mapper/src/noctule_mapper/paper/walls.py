"""Walls from feature points: extended Hough transform and least squares (Liu et al. 2019, Section IV.B-C)."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import WallConfig
from noctule_mapper.contour.reflectors import Line
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.hough_transform import line_accumulator


@dataclass(frozen=True)
class FittedWall:
    """A wall, the covariance of its (theta, rho), (2, 2), and the numbers of its feature points."""

    line: Line
    covariance: np.ndarray
    members: np.ndarray


def orthogonal_line(x_m: np.ndarray, y_m: np.ndarray, sigma_m: np.ndarray | float = 1.0) -> tuple[float, float]:
    """The line (theta_rad, rho_m) with the least squared distances, each over its ``sigma_m``, to the points (n,), n of
    at least 2.

    In place of Eq. 10-14, which minimise along y and so fail on walls parallel to it.
    """
    weight = 1 / np.broadcast_to(sigma_m, x_m.shape) ** 2
    cx, cy = np.average(x_m, weights=weight), np.average(y_m, weights=weight)
    u, v = x_m - cx, y_m - cy
    theta = 0.5 * np.arctan2(2 * (weight * u * v).sum(), (weight * (u * u - v * v)).sum()) + np.pi / 2
    return float(theta), float(cx * np.cos(theta) + cy * np.sin(theta))


def extended_hough(points: FeaturePoints, config: WallConfig) -> list[FittedWall]:
    """Walls one by one (Fig. 10): the highest peak, the points that deviate little from it, their least-squares line;
    then without them the next.

    The deviation test is Eq. 15 with rho_max in it, |x cos + y sin - rho_max| <= k sigma, sigma the point's own; it is
    made once more about the fitted line, for a peak is only as good as its bins. And a wall is touched square on: what
    was touched in another direction belongs to another wall, though it lies on this one's line.
    """
    left = np.arange(len(points.x_m))
    walls = []
    while len(left) >= config.least_points:
        found = _highest_wall(points.take(left), config)
        if found is None:
            break
        near, theta, rho = found
        members = points.take(left[near])
        line = outward(members, theta, rho)
        walls.append(FittedWall(line, _covariance(line, members), left[near]))
        left = left[~near]
    return walls


def _highest_wall(points: FeaturePoints, config: WallConfig) -> tuple[np.ndarray, float, float] | None:
    """Which points, bool (n,), deviate little from the highest peak, and their line (theta, rho); None where too few
    do.
    """
    theta, rho, _ = line_accumulator(points.x_m, points.y_m, config.theta_bin_rad, config.rho_bin_m).peak()
    near = np.ones(len(points.x_m), bool)
    for bins_m in (config.rho_bin_m, 0.0):
        near = _deviates_little(points, theta, rho, bins_m, config)
        if near.sum() < config.least_points:
            return None
        theta, rho = orthogonal_line(points.x_m[near], points.y_m[near], points.sigma_m[near])
    return near, theta, rho


def _deviates_little(
    points: FeaturePoints, theta_rad: float, rho_m: float, bins_m: float, config: WallConfig
) -> np.ndarray:
    """Eq. 15 for each point, bool (n,), and its direction against the normal."""
    deviation = np.abs(points.x_m * np.cos(theta_rad) + points.y_m * np.sin(theta_rad) - rho_m)
    square_on = np.abs(np.sin(points.direction_rad - theta_rad)) <= np.sin(config.deviation_rad)
    return square_on & (deviation <= config.deviation_sigmas * points.sigma_m + bins_m)


def outward(points: FeaturePoints, theta_rad: float, rho_m: float) -> Line:
    """The wall on the line, its normal turned away from where its points were heard, from its first point to its
    last.
    """
    if np.cos(points.direction_rad - theta_rad).sum() < 0:
        theta_rad, rho_m = theta_rad + np.pi, -rho_m
    line = Line(float(np.arctan2(np.sin(theta_rad), np.cos(theta_rad))), rho_m)
    along = points.x_m * line.tangent[0] + points.y_m * line.tangent[1]
    return Line(line.theta_rad, line.rho_m, float(along.min()), float(along.max()))


def _covariance(line: Line, points: FeaturePoints) -> np.ndarray:
    """Of (theta, rho), (2, 2), from the points' errors."""
    along = points.x_m * line.tangent[0] + points.y_m * line.tangent[1]
    slopes = np.stack([-along, np.ones(len(along))], axis=1) / points.sigma_m[:, None]
    return np.linalg.inv(slopes.T @ slopes)
