"""The fit of a right-angled frame: one turn and the distances of its sides, from directions and ranges of one place."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.readings.angles import wrapped
from noctule_mapper.refinement.right_angles import SIDES, Frame, Heard

_STEPS = 6
_WEAK = 1e-9  # keeps a side that nothing tells where it is
_BLUNT_SIGMAS = 2.0  # beyond these a direction weighs less: its plateau ran into another


@dataclass(frozen=True)
class FittedFrame:
    """``turn_rad`` and ``distance_m`` (4,) of a frame; ``covariance`` (5, 5) is of the turn and the four distances."""

    turn_rad: float
    distance_m: np.ndarray
    covariance: np.ndarray

    def normal_rad(self, side: int) -> float:
        """Direction of a side's outward normal."""
        return self.turn_rad + side * np.pi / 2


def fit_frame(frame: Frame, heard: Heard) -> FittedFrame:
    """Least squares on the ranges and directions of the plateaus that ``frame`` claims.

    wall k        R = d_k                        direction = turn + k pi / 2
    corner k, l   R = root(d_k^2 + d_l^2)        direction = turn + k pi / 2 + arctan(d_l / d_k)
    """
    distance_m = np.where(np.isnan(frame.distance_m), 1.0, frame.distance_m)
    turn_rad = frame.turn_rad
    for _ in range(_STEPS):
        rows, residual, sigma = _linearised(frame, heard, turn_rad, distance_m)
        weight = 1 / np.maximum(1, np.abs(residual / sigma) / _BLUNT_SIGMAS) / sigma**2
        covariance = np.linalg.inv(rows.T @ (weight[:, None] * rows) + _WEAK * np.eye(1 + SIDES))
        step = covariance @ rows.T @ (weight * residual)
        turn_rad, distance_m = turn_rad + float(step[0]), np.maximum(distance_m + step[1:], 1e-3)
    return FittedFrame(turn_rad, distance_m, covariance)


def _linearised(
    frame: Frame, heard: Heard, turn_rad: float, distance_m: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Slopes (m, 5), residuals and standard deviations (m,) of all ranges and directions."""
    rows, residual, sigma = [], [], []
    for side, number in enumerate(frame.walls):
        if number >= 0:
            by_range, by_turn = np.zeros(1 + SIDES), np.zeros(1 + SIDES)
            by_range[1 + side], by_turn[0] = 1, 1
            towards_rad = turn_rad + side * np.pi / 2
            rows += [by_range, by_turn]
            residual += _residuals(heard, number, float(distance_m[side]), towards_rad)
            sigma += [heard.range_sigma_m[number], heard.direction_sigma_rad[number]]
    for side, number in enumerate(frame.corners):
        if number >= 0:
            other = (side + 1) % SIDES
            near, far = float(distance_m[side]), float(distance_m[other])
            range_m = float(np.hypot(near, far))
            by_range, by_turn = np.zeros(1 + SIDES), np.zeros(1 + SIDES)
            by_range[[1 + side, 1 + other]] = near / range_m, far / range_m
            by_turn[[0, 1 + side, 1 + other]] = 1, -far / range_m**2, near / range_m**2
            rows += [by_range, by_turn]
            residual += _residuals(heard, number, range_m, turn_rad + side * np.pi / 2 + np.arctan2(far, near))
            sigma += [heard.range_sigma_m[number], heard.direction_sigma_rad[number]]
    return np.array(rows), np.array(residual), np.array(sigma)


def _residuals(heard: Heard, number: int, range_m: float, towards_rad: float) -> list[float]:
    turned_rad = float(wrapped(heard.direction_rad[number] - towards_rad))
    return [float(heard.range_m[number]) - range_m, turned_rad]
