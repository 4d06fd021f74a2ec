"""Cylinders from feature points: RANSAC Hough transform, least-squares circle (Liu et al. 2019, Section IV.D)."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import CylinderConfig
from noctule_mapper.contour.reflectors import Circle
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.readings.angles import wrapped


@dataclass(frozen=True)
class FittedCylinder:
    """A cylinder, the covariance of its (x, y, radius), (3, 3), and the numbers of its points."""

    circle: Circle
    covariance: np.ndarray
    members: np.ndarray


def least_squares_circle(
    x_m: np.ndarray, y_m: np.ndarray, sigma_m: np.ndarray | float = 1.0
) -> tuple[float, float, float]:
    """The circle (x, y, radius) of Eq. 16-19 through points (n,), each weighed by 1 / ``sigma_m``^2; n of at least 3
    and not on one line.

    Setting the derivatives (Eq. 19) of sum (u^2 + v^2 - 2 u uc - 2 v vc - c)^2 (Eq. 16-18) to zero, u and v from the
    mean (Eq. 23), gives Suu uc + Suv vc = (Suuu + Suvv) / 2 and Suv uc + Svv vc = (Svvv + Suuv) / 2. Eq. 20-21 print
    S_uvv where S_uuv belongs, and Eq. 22 lacks 1/N: the radius is the root of the mean squared distance.
    """
    weight = 1 / np.broadcast_to(sigma_m, x_m.shape) ** 2
    weight = weight / weight.sum()
    x, y = (weight * x_m).sum(), (weight * y_m).sum()
    u, v = x_m - x, y_m - y
    suu, suv, svv = ((weight * one).sum() for one in (u * u, u * v, v * v))
    suuu, suuv, suvv, svvv = ((weight * one).sum() for one in (u**3, u * u * v, u * v * v, v**3))
    # Eq. 20-21
    uc, vc = np.linalg.solve([[suu, suv], [suv, svv]], [(suuu + suvv) / 2, (svvv + suuv) / 2])
    radius = np.sqrt((weight * ((u - uc) ** 2 + (v - vc) ** 2)).sum())  # Eq. 22
    return float(uc + x), float(vc + y), float(radius)


def ransac_hough(points: FeaturePoints, places_m: np.ndarray, config: CylinderConfig) -> list[FittedCylinder]:
    """Circles one by one among the points, heard from ``places_m`` (p, 2), after Section IV.D.1.

    1. Random circles through three points, each with a ring about it; the points on it are counted sector by sector,
    and their total over the number of sectors that should contain points is the circle's proportion. 2. Of the ten of
    the highest proportion the one whose sectors' counts vary least. 3. Its points' least-squares circle, and the same
    without them.
    """
    rng = np.random.default_rng(config.seed)
    left = np.arange(len(points.x_m))
    found = []
    while len(left) >= config.least_points:
        best = _best_ring(points.take(left), places_m, config, rng)
        if best is None:
            break
        members = points.take(left[best])
        circle = Circle(*least_squares_circle(members.x_m, members.y_m, members.sigma_m))
        covariance = _covariance(circle, members)
        sized = config.smallest_radius_m <= circle.radius_m <= config.largest_radius_m
        if sized and np.sqrt(np.diag(covariance)).max() <= config.most_sigma_m:
            found.append(FittedCylinder(circle, covariance, left[best]))
        left = left[~best]
    return found


def _best_ring(
    points: FeaturePoints, places_m: np.ndarray, config: CylinderConfig, rng: np.random.Generator
) -> np.ndarray | None:
    """Which points, bool (n,), lie on the ring of the best circle; None where no circle is filled enough."""
    drawn = rng.permuted(np.tile(np.arange(len(points.x_m)), (config.trials, 1)), axis=1)[:, :3]
    circles = circles_through(points.x_m[drawn], points.y_m[drawn])
    circles = circles[(circles[:, 2] >= config.smallest_radius_m) & (circles[:, 2] <= config.largest_radius_m)]
    away, sector = _polar(circles, points.x_m, points.y_m, config)
    on_ring = np.abs(away - circles[:, 2:]) <= config.ring_sigmas * points.sigma_m
    on_ring &= _square_on(circles, points, config)
    counts = _per_sector(sector, on_ring, config)
    away, sector = _polar(circles, places_m[:, 0], places_m[:, 1], config)
    heard_from = (away > circles[:, 2:]) & (away - circles[:, 2:] <= config.reach_m)
    # A place touches a circle in its own direction, so the sectors that should contain points are those of the places.
    due = (_per_sector(sector, heard_from, config) > 0) | (counts > 0)
    total, sectors = counts.sum(axis=1), due.sum(axis=1)
    proportion = total / np.maximum(sectors, 1)
    filled = (counts > 0).sum(axis=1) / np.maximum(sectors, 1)
    good = np.nonzero((total >= config.least_points) & (filled >= config.least_filled))[0]
    if not len(good):
        return None
    finalists = good[np.argsort(-proportion[good], kind="stable")[: config.finalists]]
    return on_ring[finalists[_variance(counts[finalists], due[finalists]).argmin()]]


def _polar(
    circles: np.ndarray, x_m: np.ndarray, y_m: np.ndarray, config: CylinderConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Distance from each circle's centre and number of the sector about it, (m, n) each."""
    dx, dy = x_m - circles[:, :1], y_m - circles[:, 1:2]
    turn = np.arctan2(dy, dx) / (2 * np.pi) + 0.5
    return np.hypot(dx, dy), np.floor(turn * config.sectors).astype(int) % config.sectors


def _square_on(circles: np.ndarray, points: FeaturePoints, config: CylinderConfig) -> np.ndarray:
    """Whether each point was touched towards each circle's centre, bool (m, n), as far as its place along the ring is
    known; the echoes of a corner weren't.
    """
    inwards = np.arctan2(circles[:, 1:2] - points.y_m, circles[:, :1] - points.x_m)
    slack_rad = config.ring_sigmas * points.sigma_along_m / circles[:, 2:]
    return np.abs(wrapped(points.direction_rad - inwards)) <= config.deviation_rad + slack_rad


def _per_sector(sector: np.ndarray, counted: np.ndarray, config: CylinderConfig) -> np.ndarray:
    """How many of the ``counted``, bool (m, n), lie in each sector, (m, sectors)."""
    return np.stack([(counted & (sector == one)).sum(axis=1) for one in range(config.sectors)], axis=1)


def _variance(counts: np.ndarray, due: np.ndarray) -> np.ndarray:
    """Variance of the counts over the sectors that are ``due``, (m,)."""
    mean = counts.sum(axis=1) / due.sum(axis=1)
    return (due * (counts - mean[:, None]) ** 2).sum(axis=1) / due.sum(axis=1)


def circles_through(x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Circles (x, y, radius) through triples of points, ``x_m`` and ``y_m`` (m, 3); rows of NaN where these lie on a
    line.
    """
    bx, by, cx, cy = x_m[:, 1] - x_m[:, 0], y_m[:, 1] - y_m[:, 0], x_m[:, 2] - x_m[:, 0], y_m[:, 2] - y_m[:, 0]
    twice_area = 2 * (bx * cy - by * cx)
    twice_area = np.where(np.abs(twice_area) < 1e-12, np.nan, twice_area)
    b, c = bx**2 + by**2, cx**2 + cy**2
    ux, uy = (cy * b - by * c) / twice_area, (bx * c - cx * b) / twice_area
    return np.stack([x_m[:, 0] + ux, y_m[:, 0] + uy, np.hypot(ux, uy)], axis=1)


def _covariance(circle: Circle, points: FeaturePoints) -> np.ndarray:
    direction = np.arctan2(points.y_m - circle.y_m, points.x_m - circle.x_m)
    slopes = np.stack([np.cos(direction), np.sin(direction), np.ones(len(direction))], axis=1) / points.sigma_m[:, None]
    return np.linalg.inv(slopes.T @ slopes + 1e-9 * np.eye(3))
