"""The method ``hough``, the paper's baseline (Liu et al. 2019, Tables I-III, columns HT and RHT): peaks of Hough
transforms of the feature points, no least squares.
"""

import numpy as np

from noctule_mapper.config import HoughConfig, MapperConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.contour.contour import Contour
from noctule_mapper.contour.reflectors import Circle
from noctule_mapper.paper.cylinders import FittedCylinder
from noctule_mapper.paper.eht_lsm import contour_from
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.hough_transform import (
    LineAccumulator,
    line_accumulator,
    line_peaks,
    randomised_circle,
    randomised_line_accumulator,
)
from noctule_mapper.paper.walls import FittedWall, outward
from noctule_mapper.readings.echoes import Echoes


def hough(points: FeaturePoints, echoes: Echoes, config: MapperConfig) -> Contour:
    """The contour that Hough transforms of the feature points give; ``echoes``, at least one, only tell which walls can
    meet.
    """
    walls = hough_walls(points.take(points.kind == Kind.WALL), config.hough)
    cylinders = hough_cylinders(points.take(points.kind == Kind.CYLINDER), config.hough)
    return contour_from(walls, cylinders, echoes, config, bin_m=config.hough.rho_bin_m)


def hough_walls(points: FeaturePoints, config: HoughConfig) -> list[FittedWall]:
    """Peaks of the accumulator, highest first, as far as each has ``least_points`` that no higher one goes through."""
    if len(points.x_m) < config.least_points:
        return []
    least_votes = config.least_points if config.lines == "standard" else 1
    peaks = line_peaks(_accumulated(points, config), least_votes, config.window_rad, config.window_m)
    covariance = np.diag([config.theta_bin_rad**2, config.rho_bin_m**2]) / 12  # of a place anywhere in its bin
    free = np.ones(len(points.x_m), bool)
    walls = []
    for theta, rho, _ in peaks:
        on_line = np.abs(points.x_m * np.cos(theta) + points.y_m * np.sin(theta) - rho) <= config.ring_m
        members = np.nonzero(free & on_line)[0]
        if len(members) >= config.least_points:
            line = outward(points.take(members), theta, rho)
            walls.append(FittedWall(line, covariance, members))
            free[members] = False
    return walls


def _accumulated(points: FeaturePoints, config: HoughConfig) -> LineAccumulator:
    if config.lines == "standard":
        return line_accumulator(points.x_m, points.y_m, config.theta_bin_rad, config.rho_bin_m)
    rng = np.random.default_rng(config.seed)
    return randomised_line_accumulator(
        points.x_m, points.y_m, config.theta_bin_rad, config.rho_bin_m, config.pairs, rng
    )


def hough_cylinders(points: FeaturePoints, config: HoughConfig) -> list[FittedCylinder]:
    """The peak of random triples' circles, then the same without the points about it, as long as there are
    enough.
    """
    rng = np.random.default_rng(config.seed)
    radii_m = (config.smallest_radius_m, config.largest_radius_m)
    covariance = np.diag([config.circle_bin_m**2] * 3) / 12
    left = np.arange(len(points.x_m))
    cylinders = []
    while len(left) >= config.least_circle_points:
        x_m, y_m = points.x_m[left], points.y_m[left]
        peak = randomised_circle(x_m, y_m, config.circle_bin_m, radii_m, config.triples, rng)
        if peak is None:
            break
        x, y, radius, _ = peak
        near = np.abs(np.hypot(x_m - x, y_m - y) - radius) <= config.ring_m
        if near.sum() < config.least_circle_points:
            break
        cylinders.append(FittedCylinder(Circle(x, y, radius), covariance, left[near]))
        left = left[~near]
    return cylinders
