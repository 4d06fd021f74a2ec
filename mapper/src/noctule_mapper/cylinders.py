"""Cylinders from feature points: RANSAC Hough transform, least-squares circle (Liu et al. 2019, Section IV.D)."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import CylinderConfig
from noctule_mapper.reflectors import Circle


@dataclass(frozen=True)
class FittedCylinder:
    """A cylinder, the covariance of its (x, y, radius), (3, 3), and the numbers of its points."""

    circle: Circle
    covariance: np.ndarray
    members: np.ndarray


def least_squares_circle(x_m: np.ndarray, y_m: np.ndarray) -> tuple[float, float, float]:
    """The circle (x, y, radius) of Eq. 16-19 through points (n,), n of at least 3 and not on one line.

    Setting the derivatives of sum (u^2 + v^2 - 2 u uc - 2 v vc - c)^2 to zero, u and v from the mean, gives Suu uc +
    Suv vc = (Suuu + Suvv) / 2 and Suv uc + Svv vc = (Svvv + Suuv) / 2; Eq. 20-21 print S_uvv where S_uuv belongs, and
    Eq. 22 lacks 1/N: the radius is the root of the mean squared distance.
    """
    u, v = x_m - x_m.mean(), y_m - y_m.mean()
    matrix = np.array([[(u * u).sum(), (u * v).sum()], [(u * v).sum(), (v * v).sum()]])
    right = np.array([(u**3).sum() + (u * v * v).sum(), (v**3).sum() + (u * u * v).sum()]) / 2
    uc, vc = np.linalg.solve(matrix, right)
    radius = np.sqrt(((u - uc) ** 2 + (v - vc) ** 2).mean())
    return float(uc + x_m.mean()), float(vc + y_m.mean()), float(radius)


def ransac_hough(x_m: np.ndarray, y_m: np.ndarray, sigma_m: float, config: CylinderConfig) -> list[FittedCylinder]:
    """Circles one by one among points (n,): of random circles through three points, the ten with the most points per
    sector; of these the one whose sectors are filled most evenly; its points' least-squares circle; then without them
    the next.
    """
    rng = np.random.default_rng(config.seed)
    left = np.arange(len(x_m))
    found = []
    while len(left) >= config.least_points:
        best = _best_circle(x_m[left], y_m[left], sigma_m, config, rng)
        if best is None:
            break
        members = left[best]
        circle = Circle(*least_squares_circle(x_m[members], y_m[members]))
        if config.smallest_radius_m <= circle.radius_m <= config.largest_radius_m:
            found.append(FittedCylinder(circle, _covariance(circle, x_m[members], y_m[members], sigma_m), members))
        left = left[~best]
    return found


def _best_circle(
    x: np.ndarray, y: np.ndarray, sigma_m: float, config: CylinderConfig, rng: np.random.Generator
) -> np.ndarray | None:
    """Which points, bool (n,), lie on the ring of the best circle; None where no circle has enough."""
    drawn = rng.permuted(np.tile(np.arange(len(x)), (config.trials, 1)), axis=1)[:, :3]
    circles = _through(x[drawn], y[drawn])
    sized = (circles[:, 2] >= config.smallest_radius_m) & (circles[:, 2] <= config.largest_radius_m)
    cx, cy, radius = circles[sized].T[..., None]
    on_ring = np.abs(np.hypot(x - cx, y - cy) - radius) <= config.ring_sigmas * sigma_m
    total = on_ring.sum(axis=1)
    if not len(total) or total.max() < config.least_points:
        return None
    sector = np.floor((np.arctan2(y - cy, x - cx) / (2 * np.pi) + 0.5) * config.sectors).astype(int) % config.sectors
    counts = np.stack([(on_ring & (sector == k)).sum(axis=1) for k in range(config.sectors)], axis=1)
    finalists = np.argsort(-total / config.sectors, kind="stable")[: config.finalists]
    finalists = finalists[total[finalists] >= config.least_points]
    return on_ring[finalists[counts[finalists].var(axis=1).argmin()]]


def _through(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Circles (x, y, radius) through triples of points, x and y (m, 3); rows of NaN where these lie on a line."""
    bx, by, cx, cy = x[:, 1] - x[:, 0], y[:, 1] - y[:, 0], x[:, 2] - x[:, 0], y[:, 2] - y[:, 0]
    twice_area = 2 * (bx * cy - by * cx)
    twice_area = np.where(np.abs(twice_area) < 1e-12, np.nan, twice_area)
    b, c = bx**2 + by**2, cx**2 + cy**2
    ux, uy = (cy * b - by * c) / twice_area, (bx * c - cx * b) / twice_area
    return np.stack([x[:, 0] + ux, y[:, 0] + uy, np.hypot(ux, uy)], axis=1)


def _covariance(circle: Circle, x: np.ndarray, y: np.ndarray, sigma_m: float) -> np.ndarray:
    direction = np.arctan2(y - circle.y_m, x - circle.x_m)
    slopes = np.stack([np.cos(direction), np.sin(direction), np.ones(len(x))], axis=1)
    return sigma_m**2 * np.linalg.inv(slopes.T @ slopes + 1e-9 * np.eye(3))
