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
    """The verdict, the units that are called wrong, and of each pose the squared error over its covariance."""

    seed: int
    verdict: Verdict
    named: tuple[str, ...]
    squares: tuple[float, ...]
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
    told = posed_label_fit(room, surveyed, true).room
    return Taped(
        seed,
        judge_fixed(aligned(contour, room, true), room, surveyed, told),
        tuple(pose.unit for pose in contour.poses if pose.is_wrong),
        tuple(square(pose, true[int(pose.unit[1:]) - 1]) for pose in contour.poses),
        computing_s,
    )


def independent_squares(rooms: Sequence[Taped]) -> np.ndarray:
    """The squares of one pose of each room that has any, (n,): the poses of a room share the error of its frame, and
    chi-square's bounds are for independent ones.
    """
    return np.array([one.squares[one.seed % len(one.squares)] for one in rooms if one.squares])


def square(pose: UnitPose, true: np.ndarray) -> float:
    """Squared error over covariance: chi-square with 3 degrees of freedom."""
    error = np.array([pose.x_m, pose.y_m, pose.heading_rad]) - true
    error[2] = (error[2] + np.pi) % (2 * np.pi) - np.pi
    return float(error @ np.linalg.solve(pose.covariance, error))
