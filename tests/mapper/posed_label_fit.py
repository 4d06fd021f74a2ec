"""The joint fit that is told what made every echo, but only to within a tape measure where the units are.

Its parameters are the label fit's and three of each unit, known beforehand as stated. Beside the ranges it has the
middles of the bearings at which a unit hears one thing, where nothing cuts them short: without these two units could
not tell how they are turned to one another. What it finds is moved as a whole so that it fits the room best.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from mapper.label_fit import (
    LEAST_WALL_ECHOES,
    WEAK_PRIOR,
    Heard,
    LabelFit,
    corner_points,
    distance,
    heard_of,
    parameters_of,
    predicted,
    reported,
    slopes_of,
)
from mapper.room import LabelledSweep, Room

ITERATIONS = 8
SMALLEST_STEP = 1e-7  # metres or radians
STEP_SHARE = 0.3  # of the step of bearings: the error of the middle of those that heard one thing
KNOWN_M = 0.1  # a corner, or the frame's error included: worse ones do not say where the room lies


@dataclass(frozen=True)
class PosedLabelFit:
    """The room, and the units' poses (units, 3) with the covariance of each, (units, 3, 3), and of all together,
    (3 units, 3 units).
    """

    room: LabelFit
    poses: np.ndarray
    pose_covariances: np.ndarray
    all_poses_covariance: np.ndarray


@dataclass(frozen=True)
class Middles:
    """Of what a unit heard, (n,): its place in the units, the bearing of its middle and what made it."""

    unit: np.ndarray
    bearing_rad: np.ndarray
    sigma_rad: np.ndarray
    kind: np.ndarray
    number: np.ndarray


def posed_label_fit(room: Room, surveyed: Sequence[LabelledSweep], true: np.ndarray) -> PosedLabelFit:
    """The best estimate of ``room`` and of the poses, ``true`` (units, 3), from which Gauss-Newton begins."""
    heard, unit, middles = heard_of(surveyed), _units(surveyed), _middles(surveyed)
    acute, flat = room.interior_rad < np.pi / 2, parameters_of(room)
    stated, sigma = _stated(surveyed, true)
    truth = parameters = np.concatenate([flat, true.ravel()])

    def expected(tried: np.ndarray) -> np.ndarray:
        """Ranges, then the sines of what the middles are off, in units of their errors; then the poses."""
        poses = tried[len(flat) :].reshape(-1, 3)
        ranges = predicted(tried[: len(flat)], poses[unit, :2].T, acute, heard)
        off = _off(tried[: len(flat)], poses, len(acute), middles)
        return np.concatenate([ranges / heard.sigma_m, off / middles.sigma_rad, (poses / sigma).ravel()])

    measured = np.concatenate([heard.range_m / heard.sigma_m, np.zeros(len(middles.unit)), (stated / sigma).ravel()])
    information = np.eye(len(truth))
    for _ in range(ITERATIONS):
        slopes = slopes_of(expected, parameters)
        information = slopes.T @ slopes + WEAK_PRIOR * np.eye(len(truth))
        residual = measured - np.real(expected(parameters))
        step = np.linalg.solve(information, slopes.T @ residual + WEAK_PRIOR * (truth - parameters))
        parameters = parameters + _bounded(step, parameters, lambda tried: measured - np.real(expected(tried)))
    covariance = np.linalg.inv(information)
    poses = parameters[len(flat) :].reshape(-1, 3)
    of_poses = np.array([covariance[i : i + 3, i : i + 3] for i in range(len(flat), len(truth), 3)])
    moved, held = _aligned(parameters[: len(flat)], covariance[: len(flat), : len(flat)], room, heard)
    of_all = covariance[len(flat) :, len(flat) :]
    return PosedLabelFit(reported(moved, held, len(acute), heard), poses, of_poses, of_all)


def _bounded(step: np.ndarray, parameters: np.ndarray, residual: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """As much of ``step`` as does not fit worse: a wall that is hardly known turns far in one."""
    now = (residual(parameters) ** 2).sum()
    while (residual(parameters + step) ** 2).sum() > now and np.abs(step).max() > SMALLEST_STEP:
        step = step / 2
    return step


def _units(surveyed: Sequence[LabelledSweep]) -> np.ndarray:
    """Of which unit each echo of known make is, as heard_of() has them."""
    return np.array(
        [
            int(one.sweep.unit[1:]) - 1
            for one in surveyed
            for i, label in enumerate(one.labels)
            if label.index >= 0 and np.isfinite(one.sweep.range_m[i])
        ],
        dtype=int,
    )


def _stated(surveyed: Sequence[LabelledSweep], true: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The stated poses, each heading within half a turn of the true one, and their sigmas; (units, 3) both."""
    stated, sigma = true.copy(), np.full_like(true, np.inf)
    for one in surveyed:
        sweep, unit = one.sweep, int(one.sweep.unit[1:]) - 1
        turn = (sweep.heading_rad - true[unit, 2] + np.pi) % (2 * np.pi) - np.pi
        stated[unit] = sweep.x_m, sweep.y_m, true[unit, 2] + turn
        sigma[unit] = sweep.sigma_position_m, sweep.sigma_position_m, sweep.sigma_heading_rad
    return stated, sigma


def _middles(surveyed: Sequence[LabelledSweep]) -> Middles:
    found = []
    for name in sorted({one.sweep.unit for one in surveyed}):
        sweeps = [one for one in surveyed if one.sweep.unit == name]
        bearing_rad = sweeps[0].sweep.bearing_rad
        for label in sorted({label for one in sweeps for label in one.labels if label.index >= 0}):
            at = [i for i in range(len(bearing_rad)) if any(one.labels[i] == label for one in sweeps)]
            beyond = at[0] - 1, at[-1] + 1
            if beyond[0] >= 0 and beyond[1] < len(bearing_rad) and not any(_cut(sweeps, i) for i in beyond):
                middle_rad = (bearing_rad[at[0]] + bearing_rad[at[-1]]) / 2
                sigma_rad = STEP_SHARE * float(np.median(np.abs(np.diff(bearing_rad))))
                found.append((int(name[1:]) - 1, middle_rad, sigma_rad, label.kind, label.index))
    unit, middle_rad, sigma_rad, kind, number = zip(*found, strict=True) if found else ((), (), (), (), ())
    return Middles(
        np.array(unit, int), np.array(middle_rad), np.array(sigma_rad), np.array(kind, str), np.array(number, int)
    )


def _cut(sweeps: Sequence[LabelledSweep], bearing: int) -> bool:
    """Whether a sweep heard something there, so that what answers up to there may go on behind it."""
    return any(one.labels[bearing].kind != "none" for one in sweeps)


def _off(parameters: np.ndarray, poses: np.ndarray, corners: int, middles: Middles) -> np.ndarray:
    """Sines of the angles from the middles to what made them, (n,)."""
    place, axis = poses[middles.unit, :2].T, poses[middles.unit, 2] + middles.bearing_rad
    theta = parameters[: 2 * corners].reshape(-1, 2)[:, 0]
    normal = np.zeros((2, len(axis)), dtype=complex)
    on = middles.kind == "wall"
    normal[:, on] = np.cos(theta[middles.number[on]]), np.sin(theta[middles.number[on]])
    centres = parameters[2 * corners :].reshape(-1, 3)[:, :2]
    for on, points in (
        (middles.kind == "cylinder", centres),
        ((middles.kind == "corner") | (middles.kind == "edge"), corner_points(parameters, corners)),
    ):
        towards = points[middles.number[on]].T
        normal[:, on] = (towards - place[:, on]) / distance(towards, place[:, on])
    return np.cos(axis) * normal[1] - np.sin(axis) * normal[0]


def _aligned(parameters: np.ndarray, covariance: np.ndarray, room: Room, heard: Heard) -> tuple[np.ndarray, np.ndarray]:
    """The room moved as a whole so that its corners of heard walls lie best, and its covariance then."""
    corners = len(room.vertices)
    lonely = np.bincount(heard.number[heard.by_wall], minlength=corners) < LEAST_WALL_ECHOES
    by_all = slopes_of(lambda tried: corner_points(tried, corners), parameters)
    sigma_m = np.sqrt(np.einsum("cip,pq,ciq->c", by_all, covariance, by_all))
    sigma_m[lonely | np.roll(lonely, 1)] = np.inf
    known = np.repeat(sigma_m <= max(KNOWN_M, np.sort(sigma_m)[1]), 2)

    def points(tried: np.ndarray) -> np.ndarray:
        return corner_points(tried, corners).ravel()[known]

    for _ in range(3):
        together = slopes_of(points, parameters) @ _motion(parameters, corners)
        off = room.vertices.ravel()[known] - np.real(points(parameters))
        parameters = np.real(_moved(parameters, np.linalg.lstsq(together, off, rcond=None)[0], corners))
    slopes, motion = slopes_of(points, parameters), _motion(parameters, corners)
    rest = np.eye(len(parameters)) - motion @ np.linalg.pinv(slopes @ motion) @ slopes
    return parameters, rest @ covariance @ rest.T


def _motion(parameters: np.ndarray, corners: int) -> np.ndarray:
    """Derivatives of the parameters by a shift and a turn of all of them together, (parameters, 3)."""
    return slopes_of(lambda by: _moved(parameters, by, corners), np.zeros(3))


def _moved(parameters: np.ndarray, by: np.ndarray, corners: int) -> np.ndarray:
    """Walls and cylinders turned about the origin by ``by[2]`` and then shifted by ``by[:2]``."""
    walls, cylinders = parameters[: 2 * corners].reshape(-1, 2), parameters[2 * corners :].reshape(-1, 3)
    theta = walls[:, 0] + by[2]
    rho = walls[:, 1] + by[0] * np.cos(theta) + by[1] * np.sin(theta)
    cosine, sine = np.cos(by[2]), np.sin(by[2])
    x = cosine * cylinders[:, 0] - sine * cylinders[:, 1] + by[0]
    y = sine * cylinders[:, 0] + cosine * cylinders[:, 1] + by[1]
    radius = cylinders[:, 2] + 0 * by[0]
    return np.concatenate([np.stack([theta, rho], axis=1).ravel(), np.stack([x, y, radius], axis=1).ravel()])
