"""Hough transforms of points: of all points for lines (Liu et al. 2019, Section IV.A), of random pairs and triples for
lines and circles (randomised, RHT).

The accumulators' bins are all the accuracy there is: nothing is fitted.
"""

import math
from dataclasses import dataclass

import numpy as np

from noctule_mapper.paper.cylinders import circles_through

_LEAST_SINE = 1e-6


@dataclass(frozen=True)
class LineAccumulator:
    """Votes for lines x cos theta + y sin theta = rho; theta_rad (thetas,) from 0 up to pi, rho_m (rhos,).

    Only bins with votes are kept, ``row`` after row, each with its ``column`` and ``count``, (m,): so the memory goes
    by the number of points, not by how far from one another and from the origin they lie.
    """

    theta_rad: np.ndarray
    lowest: int  # rho of column 0, in bins
    rho_bin_m: float
    row: np.ndarray
    column: np.ndarray
    count: np.ndarray

    @property
    def rho_m(self) -> np.ndarray:
        """Of each column, (rhos,)."""
        return (np.arange(self.column.max() + 1) + self.lowest) * self.rho_bin_m

    @property
    def votes(self) -> np.ndarray:
        """All bins, int (thetas, rhos)."""
        votes = np.zeros((len(self.theta_rad), self.column.max() + 1), int)
        votes[self.row, self.column] = self.count
        return votes

    def peak(self) -> tuple[float, float, int]:
        """The bin (theta_rad, rho_m) with the most votes, and these."""
        at = self.count.argmax()
        rho_m = (self.column[at] + self.lowest) * self.rho_bin_m
        return float(self.theta_rad[self.row[at]]), float(rho_m), int(self.count[at])


def line_accumulator(x_m: np.ndarray, y_m: np.ndarray, theta_bin_rad: float, rho_bin_m: float) -> LineAccumulator:
    """Eq. 9, rho = x cos theta + y sin theta: every point (n,), n of at least 1, votes for a rho at each theta."""
    theta = np.arange(0, np.pi, theta_bin_rad)
    rho = np.outer(x_m, np.cos(theta)) + np.outer(y_m, np.sin(theta))
    return _counted(np.broadcast_to(np.arange(len(theta)), rho.shape), rho, theta, rho_bin_m)


def randomised_line_accumulator(
    x_m: np.ndarray, y_m: np.ndarray, theta_bin_rad: float, rho_bin_m: float, pairs: int, rng: np.random.Generator
) -> LineAccumulator:
    """RHT: random ``pairs`` of the points (n,), n of at least 2, vote for the one line through both."""
    first = rng.integers(0, len(x_m), pairs)
    second = (first + rng.integers(1, len(x_m), pairs)) % len(x_m)
    theta = np.arctan2(x_m[first] - x_m[second], y_m[second] - y_m[first]) % np.pi
    bins = np.arange(0, np.pi, theta_bin_rad)
    row = np.rint(theta / theta_bin_rad).astype(int)
    turned = row == len(bins)  # theta of about pi is theta 0 with rho on the other side
    row = np.where(turned, 0, row)
    rho = np.where(turned, -1, 1) * (x_m[first] * np.cos(theta) + y_m[first] * np.sin(theta))
    return _counted(row, rho, bins, rho_bin_m)


def _counted(row: np.ndarray, rho_m: np.ndarray, theta_rad: np.ndarray, rho_bin_m: float) -> LineAccumulator:
    lowest = math.floor(rho_m.min() / rho_bin_m)
    column = np.rint(rho_m / rho_bin_m - lowest).astype(int)
    columns = int(column.max()) + 1
    bins, count = np.unique(row * columns + column, return_counts=True)
    return LineAccumulator(theta_rad, lowest, rho_bin_m, bins // columns, bins % columns, count)


def line_peaks(
    accumulator: LineAccumulator, least_votes: int, window_rad: float, window_m: float
) -> list[tuple[float, float, int]]:
    """Peaks (theta_rad, rho_m, votes), highest first: bins that no higher peak within the window suppresses."""
    high = np.nonzero(accumulator.count >= least_votes)[0]
    high = high[np.argsort(-accumulator.count[high], kind="stable")]
    theta, height = accumulator.theta_rad[accumulator.row[high]], accumulator.count[high]
    rho = (accumulator.column[high] + accumulator.lowest) * accumulator.rho_bin_m
    peaks = []
    while len(theta):
        peaks.append((float(theta[0]), float(rho[0]), int(height[0])))
        turn = np.abs(theta - theta[0])
        round_ = turn > np.pi / 2  # (theta, rho) and (theta - pi, -rho) are one line
        turn, other = np.where(round_, np.pi - turn, turn), np.where(round_, -rho, rho)
        left = (turn > window_rad) | (np.abs(other - rho[0]) > window_m)
        theta, rho, height = theta[left], rho[left], height[left]
    return peaks


def randomised_circle(
    x_m: np.ndarray,
    y_m: np.ndarray,
    tolerance_m: float,
    radii_m: tuple[float, float],
    triples: int,
    rng: np.random.Generator,
) -> tuple[float, float, float, int] | None:
    """RHT: random ``triples`` of points (n,), n of at least 3, vote for the circle through them; the peak (x, y,
    radius) and its votes.

    A vote falls into a bin of ``tolerance_m`` in each of the three; None where no circle has a radius within
    ``radii_m``.
    """
    drawn = rng.permuted(np.tile(np.arange(len(x_m)), (triples, 1)), axis=1)[:, :3]
    circles = circles_through(x_m[drawn], y_m[drawn])
    circles = circles[(circles[:, 2] >= radii_m[0]) & (circles[:, 2] <= radii_m[1])]
    if not len(circles):
        return None
    bins, votes = np.unique(np.rint(circles / tolerance_m).astype(int), axis=0, return_counts=True)
    x, y, radius = bins[votes.argmax()] * tolerance_m
    return float(x), float(y), float(radius), int(votes.max())
