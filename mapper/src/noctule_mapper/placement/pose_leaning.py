"""How much of a pose leans on single plateaus: the jackknife's covariance, by leaving out each plateau in turn.

A plateau that was taken for another landmark's pulls its unit away from where all the others have it, and least squares
does not see that. Where one plateau more or less moves the pose, the pose is not known better than that.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.placement.pose_adjustment import Problem, problem_of, reweighed, shared_by_several
from noctule_mapper.placement.reflector_models import Members, PlacedUnit

_STEPS = 2
_UNKNOWN = np.diag([1.0, 1.0, 1.0])  # of a unit that shares a single plateau with others: metres and radians


def leaning(units: Sequence[PlacedUnit], groups: Sequence[Members], known: int) -> list[np.ndarray]:
    """Each unit's pose's covariance (3, 3) by the jackknife (Efron 1982, section 3.1); 0 for the first ``known``."""
    exact = [one if number < known else replace(one, covariance=np.zeros((3, 3))) for number, one in enumerate(units)]
    problem = problem_of(exact, shared_by_several(groups), known)
    values = np.concatenate([np.array([one.pose for one in units]).ravel(), problem.landmark.ravel()])
    every = np.ones(problem.residuals)
    values = _adjusted(problem, values, every)
    covariances = [np.zeros((3, 3))] * known
    for number in range(known, len(units)):
        own = np.nonzero(problem.unit == number)[0]
        if len(own) < 2:
            covariances.append(_UNKNOWN)
            continue
        moves = []
        for plateau in own:
            others = every.copy()
            others[[plateau, len(problem.unit) + plateau]] = 0.0
            moves.append((_adjusted(problem, values, others) - values)[3 * number : 3 * number + 3])
        moved = np.array(moves)
        covariances.append((len(own) - 1) / len(own) * moved.T @ moved)
    return covariances


def _adjusted(problem: Problem, values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    for _ in range(_STEPS):
        values, _ = reweighed(problem, values, counts)
    return values
