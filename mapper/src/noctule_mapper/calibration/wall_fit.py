"""The wall as the readings have it, and what a tape measure then tells of their mean error.

The mean error of all ranges cancels in d = R2d - R2 (Eq. 1), so it can't come from there: to a sensor that reads long a
wall is farther away, and nothing else. It takes one distance that somebody has measured.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from noctule_mapper.calibration.wall_readings import WallReadings

OFF_WALL_M = 0.05  # a place whose mean range misses the wall by more looks at something else
_SPEED_PER_KELVIN = 0.606 / 343.0  # of the speed of sound, at 20 degrees
_LEAST_DEPTH_M = 0.2  # between nearest and farthest place, below which readings tell no scale


@dataclass(frozen=True)
class Estimate:
    """A figure and its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class WallFit:
    """The line n . p = rho that makes ranges rho - n . p; ``distance_m`` is that of the survey's first place from it.

    ``growth`` is by how much the ranges grow too fast with the distance, as a share; None where all places are about
    as far away.
    """

    theta_rad: float
    distance_m: Estimate
    growth: Estimate | None

    @property
    def kelvin_too_warm(self) -> float:
        """By how much colder air than told would explain the growth."""
        return self.growth.value / _SPEED_PER_KELVIN if self.growth else 0.0


def fit_wall(readings: WallReadings) -> WallFit | None:
    """The wall by least squares on the places' mean ranges, without places that look at something else; None where
    fewer than three places are left.
    """
    count = np.bincount(readings.place, minlength=len(readings.x_m))
    held = count > 0
    places_m = np.stack([readings.x_m, readings.y_m], axis=1)[held]
    mean_m = np.bincount(readings.place, readings.range_m, minlength=len(count))[held] / count[held]
    weight = np.sqrt(count[held])
    start = np.array([readings.facing_rad, float(np.median(mean_m + places_m @ _normal(readings.facing_rad)))])
    robust = least_squares(_misfit_m, start, args=(places_m, mean_m, weight), loss="soft_l1", f_scale=0.02)
    on_wall = np.abs(_misfit_m(robust.x, places_m, mean_m, np.ones_like(weight))) <= OFF_WALL_M
    places_m, mean_m, weight = places_m[on_wall], mean_m[on_wall], weight[on_wall]
    if len(mean_m) < 3:
        return None
    fit = least_squares(_misfit_m, robust.x, args=(places_m, mean_m, weight))
    variance = float((fit.fun**2).sum()) / (len(mean_m) - 2)
    covariance = variance * np.linalg.inv(fit.jac.T @ fit.jac)
    theta_rad, rho_m = fit.x
    away_m = rho_m - places_m @ _normal(theta_rad)
    first_m = np.array([readings.x_m[0], readings.y_m[0]])
    gradient = np.array([-float(first_m @ _tangent(theta_rad)), 1.0])
    first_away_m = float(rho_m - first_m @ _normal(theta_rad))
    distance_m = Estimate(first_away_m, math.sqrt(float(gradient @ covariance @ gradient)))
    return WallFit(float(theta_rad), distance_m, _growth(away_m, fit.fun, weight))


def _growth(away_m: np.ndarray, misfit: np.ndarray, weight: np.ndarray) -> Estimate | None:
    """Slope of the weighted ``misfit`` over the distance."""
    if len(away_m) < 4 or float(np.ptp(away_m)) < _LEAST_DEPTH_M:
        return None
    columns = np.stack([np.ones_like(away_m), away_m], axis=1) * weight[:, None]
    solution = np.linalg.lstsq(columns, misfit, rcond=None)[0]
    left = misfit - columns @ solution
    variance = float((left**2).sum()) / (len(left) - 3)
    return Estimate(float(solution[1]), math.sqrt(variance * np.linalg.inv(columns.T @ columns)[1, 1]))


def _misfit_m(wall: np.ndarray, places_m: np.ndarray, mean_m: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Range read less range to the ``wall`` (theta, rho), weighted, (places,)."""
    return weight * (mean_m - (wall[1] - places_m @ _normal(wall[0])))


def _normal(theta_rad: float) -> np.ndarray:
    return np.array([math.cos(theta_rad), math.sin(theta_rad)])


def _tangent(theta_rad: float) -> np.ndarray:
    return np.array([-math.sin(theta_rad), math.cos(theta_rad)])
