"""Simulated rooms in which units stand whose poses are unknown or stated by tape measure, mapped and judged; everything
in a room comes from its own seed.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mapper.fixed_units import Verdict, aligned, judge_fixed, survey_fixed, taped_room
from mapper.placement_oracle import tellable
from mapper.posed_label_fit import posed_label_fit
from mapper.unknown_units import Outcome, contour_of, erased, judged_room, outcome
from scipy.stats import chi2

from noctule_mapper.contour.contour import UnitPose


@dataclass(frozen=True)
class Unknown:
    """What was found of the units, which of them the room can tell, and the processor's time."""

    seed: int
    outcome: Outcome
    tellable: tuple[str, ...]
    computing_s: float


@dataclass(frozen=True)
class Taped:
    """The verdict, the units that are called wrong, of each pose the squared error over its covariance, and the
    variance of their sum.
    """

    seed: int
    verdict: Verdict
    named: tuple[str, ...]
    squares: tuple[float, ...]
    variance: float
    computing_s: float


def unknown(seed: int) -> Unknown:
    """Four to eight units, all but the first of unknown pose."""
    room, poses = judged_room(seed)
    surveyed = survey_fixed(room, poses, np.random.default_rng(seed))
    began_s = time.process_time()
    contour = contour_of([one.sweep if one.sweep.unit == "u1" else erased(one.sweep) for one in surveyed])
    computing_s = time.process_time() - began_s
    return Unknown(seed, outcome(contour, poses), tellable(room, poses, surveyed), computing_s)


def taped(seed: int) -> Taped:
    """Two to six units, their poses stated to 3 cm and 3 degrees."""
    room, true, surveyed = taped_room(np.random.default_rng(seed))
    began_s = time.process_time()
    contour = contour_of([one.sweep for one in surveyed])
    computing_s = time.process_time() - began_s
    told = posed_label_fit(room, surveyed, true)
    numbers = [int(pose.unit[1:]) - 1 for pose in contour.poses]
    return Taped(
        seed,
        judge_fixed(aligned(contour, room, true), room, surveyed, told.room),
        tuple(pose.unit for pose in contour.poses if pose.is_wrong),
        tuple(square(pose, true[number]) for number, pose in zip(numbers, contour.poses, strict=True)),
        variance_of_squares(told.all_poses_covariance, numbers),
        computing_s,
    )


def variance_of_squares(covariance: np.ndarray, numbers: Sequence[int]) -> float:
    """The variance of the sum of the squares of some poses, each over its own covariance, where the ``covariance`` of
    all poses (3 n, 3 n) is right: that of independent ones is 6 for each pose.

    With e the errors, C the covariance and D its blocks, the sum is e^T D^-1 e, which has the mean 3 n and the variance
    2 tr(D^-1 C D^-1 C).
    """
    rows = (3 * np.array(numbers, int)[:, None] + np.arange(3)).ravel()
    own = covariance[np.ix_(rows, rows)]
    blocks = own * np.kron(np.eye(len(numbers)), np.ones((3, 3)))
    together = np.linalg.solve(blocks, own)
    return float(2 * (together * together.T).sum())


def honest_bounds(rooms: Sequence[Taped]) -> tuple[float, float]:
    """Between which the mean square of a coordinate lies with a chance of 99 % if the errors are as stated.

    The poses of a room share the error of its frame, so they are worth fewer coordinates than they have: as many as
    give chi-square the variance of the sum (Satterthwaite 1946). How poses go together is taken from the label fit,
    for a contour has the covariance of each pose alone.
    """
    coordinates = 3 * sum(len(one.squares) for one in rooms)
    independent = 2 * coordinates**2 / sum(one.variance for one in rooms)
    low, high = chi2.ppf((0.005, 0.995), independent) / independent
    return float(low), float(high)


def square(pose: UnitPose, true: np.ndarray) -> float:
    """Squared error over covariance: chi-square with 3 degrees of freedom."""
    error = np.array([pose.x_m, pose.y_m, pose.heading_rad]) - true
    error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
    return float(error @ np.linalg.solve(pose.covariance, error))
