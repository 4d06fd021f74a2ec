"""The contour as the mapper knows it: walls, corners and cylinders, each with its covariance."""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Wall:
    """A wall on the line x cos(theta) + y sin(theta) = rho, seen from the side where the left-hand sum is smaller.

    ``start`` and ``end`` are (x_m, y_m), the room lying to the left of the way from one to the other; ``covariance`` is
    of (theta_rad, rho_m).
    """

    theta_rad: float
    rho_m: float
    start: tuple[float, float]
    end: tuple[float, float]
    covariance: np.ndarray
    readings: int

    @property
    def normal(self) -> np.ndarray:
        """Unit normal, out of the room, (2,)."""
        return np.array([np.cos(self.theta_rad), np.sin(self.theta_rad)])


@dataclass(frozen=True)
class Corner:
    """Where the ends of two walls meet; ``walls`` are their indices, ``covariance`` is of (x_m, y_m)."""

    x_m: float
    y_m: float
    covariance: np.ndarray
    walls: tuple[int, int]


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder; ``covariance`` is of (x_m, y_m, radius_m)."""

    x_m: float
    y_m: float
    radius_m: float
    covariance: np.ndarray
    readings: int


@dataclass(frozen=True)
class Contour:
    """A site's contour from ``sweeps`` sweeps, the newest of ``time_s`` (since 1970 UTC)."""

    walls: tuple[Wall, ...] = ()
    corners: tuple[Corner, ...] = ()
    cylinders: tuple[Cylinder, ...] = ()
    sweeps: int = 0
    time_s: float = 0.0
    method: str = ""
    range_sigma_m: float = field(default=float("nan"))  # the spread of a range that the fit went by
