"""What an arrangement of units is worth, in nats over units that each hear a place of their own; no order of the units
comes into it.

It is the logarithm of the chance of all plateaus together, by Laplace's approximation of the integral over landmarks
and poses: each group of plateaus is one landmark of any kind, silence counts once for each end of a wall and for each
point, corners lie where walls cross (``wall_crossings``), and the volume of the poses' posterior counts as a whole.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from noctule_mapper.placement.joint_silence import joint_silence_nats
from noctule_mapper.placement.landmarks import Landmarks, landmarks_of
from noctule_mapper.placement.pose_adjustment import grouped, problem_of, regrouped
from noctule_mapper.placement.pose_scores import MOST_GAIN_NATS, new_density
from noctule_mapper.placement.pose_search import HOLD, TOGETHER_NATS, anywhere, far_nats
from noctule_mapper.placement.reflector_models import (
    NEW_SHARE,
    Members,
    Models,
    PlacedUnit,
    Rows,
    all_models,
    rows_of,
)
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.placement.wall_crossings import corners_at

_WEAK = 1e-6  # of landmarks' values that nothing tells


def joint_nats(placed: Sequence[PlacedUnit], fixed: int, groups: Sequence[Members] = ()) -> float:
    """The worth of units that stand where their echoes have them together; the first ``fixed`` poses are known,
    ``groups`` are the units' plateaus by landmark, if known.
    """
    if len(placed) < 2:
        return 0.0
    if not groups:
        placed = [*placed[:fixed], *sorted(placed[fixed:], key=lambda one: one.view.unit)]
        groups = regrouped(placed, grouped(placed))
        return max(_nats(placed, fixed, one) for one in (groups, *_parted(groups)))
    return _nats(placed, fixed, groups)


def _parted(groups: Sequence[Members]) -> list[tuple[Members, ...]]:
    """The groups with one that two plateaus share taken apart. What two units hear at one place may be one reflector or
    two; whether either is a wall that makes a corner with others decides it, and no pair knows that of itself.
    """
    pairs = [number for number, group in enumerate(groups) if len(group) == 2]
    return [(*groups[:at], *((one,) for one in groups[at]), *groups[at + 1 :]) for at in pairs]


def _nats(placed: Sequence[PlacedUnit], fixed: int, groups: Sequence[Members]) -> float:
    """The worth with these ``groups``."""
    if not len(groups):  # no unit has a plateau: nothing tells where any stands
        return 0.0
    exact = [replace(one, covariance=np.zeros((3, 3))) for one in placed]
    rows, marks = rows_of(exact, groups), landmarks_of(exact, groups)
    kinds = all_models(rows)
    return (
        _gain_nats(exact, groups, rows, kinds, marks)
        - _far_nats(exact, groups, marks)
        - joint_silence_nats(exact, groups, marks)
        + corners_at(rows, kinds).nats
        - sum(_alone_nats(one.view) for one in placed)
        + _volume_nats(placed, groups, fixed)
        + (len(placed) - 1) * (TOGETHER_NATS - anywhere(marks))
    )


def _gain_nats(
    units: Sequence[PlacedUnit], groups: Sequence[Members], rows: Rows, kinds: Sequence[Models], marks: Landmarks
) -> float:
    """How much likelier the groups' plateaus are as one landmark's each than as so many landmarks'."""
    together = np.logaddexp.reduce([one.log_evidence for one in kinds]) + np.log(2 * np.pi)
    size = np.bincount(rows.group, minlength=len(groups))
    more = size - 1
    alone = np.bincount(rows.group, _alone_densities(units, groups, marks)) / size
    gain = together - more * alone + more * np.log1p(-NEW_SHARE)
    gain = np.where(more > 0, np.clip(gain, more * np.log(NEW_SHARE), more * MOST_GAIN_NATS), 0.0)
    # What a unit hears in a place of its own is no news; that all of one unit's is new goes without saying.
    own = np.mean([len(one.view) for one in units])
    return float(gain.sum() + (len(groups) - own) * np.log(NEW_SHARE))


def _alone_densities(units: Sequence[PlacedUnit], groups: Sequence[Members], marks: Landmarks) -> np.ndarray:
    """The log density of each plateau as a new landmark's, group by group (n,)."""
    of_group = [np.full(len(one.view), -1) for one in units]
    for number, group in enumerate(groups):
        for unit, plateau in group:
            of_group[unit][plateau] = number
    density = [
        new_density(unit.view, marks, unit.pose[None], own)[0] for unit, own in zip(units, of_group, strict=True)
    ]
    return np.array([density[unit][plateau] for group in groups for unit, plateau in group])


@lru_cache(maxsize=64)
def _alone_nats(view: UnitView) -> float:
    """How much likelier what one unit hears is with corners where its walls cross: no arrangement gains by that."""
    if not len(view):
        return 0.0
    rows = rows_of([PlacedUnit(view, np.zeros(3), np.zeros((3, 3)))], [((0, at),) for at in range(len(view))])
    return corners_at(rows, all_models(rows)).nats


def _far_nats(units: Sequence[PlacedUnit], groups: Sequence[Members], marks: Landmarks) -> float:
    """What gaps along walls cost between the feet that units touch."""
    cost = 0.0
    for alpha_rad, group, chance in zip(marks.alpha_rad, marks.group, marks.chance, strict=False):
        tangent = np.array([-np.sin(alpha_rad), np.cos(alpha_rad)])
        along_m = np.sort([units[unit].pose[:2] @ tangent for unit, _ in groups[group]])
        cost += chance * far_nats(np.diff(along_m)).sum()
    return float(cost)


def _volume_nats(placed: Sequence[PlacedUnit], groups: Sequence[Members], fixed: int) -> float:
    """The log volume of the posterior of the poses that are sought, the landmarks integrated out."""
    problem = problem_of(placed, groups, fixed)
    poses = np.array([one.pose for one in placed])
    _, slopes = problem.linearised(np.concatenate([poses.ravel(), problem.landmark.ravel()]))
    information = slopes.T @ slopes
    split = poses.size
    of_marks = information[split:, split:] + _WEAK * np.eye(problem.landmark.size)
    cross = information[:split, split:]
    marginal = information[:split, :split] - cross @ np.linalg.solve(of_marks, cross.T)
    marginal[3 * fixed :, 3 * fixed :] += np.kron(np.eye(len(placed) - fixed), HOLD)
    stated = -2 * np.log(problem.stated_sigma).sum()
    return float(1.5 * (len(placed) - fixed) * np.log(2 * np.pi) - 0.5 * (np.linalg.slogdet(marginal)[1] - stated))
