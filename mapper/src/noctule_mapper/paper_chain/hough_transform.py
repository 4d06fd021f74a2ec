"""Hough transforms of points: of all points for lines (Liu et al. 2019, Section IV.A), of random pairs and triples for
lines and circles (randomised, RHT).

The accumulators' bins are all the accuracy there is: nothing is fitted.
"""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.paper_chain.cylinders import circles_through

_LEAST_SINE = 1e-6


@dataclass(frozen=True)
class LineAccumulator:
    """Votes int (thetas, rhos) for lines x cos theta + y sin theta = rho; theta_rad (thetas,) from 0 up to pi, rho_m
    (rhos,).
    """

    theta_rad: np.ndarray
    rho_m: np.ndarray
    votes: np.ndarray

    def peak(self) -> tuple[float, float, int]:
        """The bin (theta_rad, rho_m) with the most votes, and these."""
        row, column = np.unravel_index(self.votes.argmax(), self.votes.shape)
        return float(self.theta_rad[row]), float(self.rho_m[column]), int(self.votes[row, column])


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
    lowest = np.floor(rho_m.min() / rho_bin_m)
    column = np.rint(rho_m / rho_bin_m - lowest).astype(int)
    votes = np.zeros((len(theta_rad), column.max() + 1), int)
    np.add.at(votes, (row, column), 1)
    return LineAccumulator(theta_rad, (np.arange(votes.shape[1]) + lowest) * rho_bin_m, votes)


def line_peaks(
    accumulator: LineAccumulator, least_votes: int, window_rad: float, window_m: float
) -> list[tuple[float, float, int]]:
    """Peaks (theta_rad, rho_m, votes), highest first: bins that no higher peak within the window suppresses."""
    rows, columns = np.nonzero(accumulator.votes >= least_votes)
    height = accumulator.votes[rows, columns]
    order = np.argsort(-height, kind="stable")
    theta, rho, height = accumulator.theta_rad[rows][order], accumulator.rho_m[columns][order], height[order]
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
