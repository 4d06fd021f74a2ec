"""Poses of units and landmarks together, by least squares on what all units hear of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from noctule_mapper.placement.landmarks import Members, PlacedUnit, landmarks_of, point_model, wall_model
from noctule_mapper.placement.pose_scores import Tolerance, matched
from noctule_mapper.readings.angles import wrapped

_EXACT_M, _EXACT_RAD = 0.001, np.radians(0.1)  # no stated pose is better
_LEAST_SHARED = 2  # units that hear a landmark, or it tells nothing of their poses
_ROBUST_SIGMAS = 2.0
# Of a point's ranges to its distance: a corner under 90 degrees answers by the sine of its angle (double bounce), a
# post by its radius nearer.
_SCALE_SIGMA = 0.08
_MOST_STEPS = 15


def grouped(units: Sequence[PlacedUnit]) -> list[Members]:
    """Which plateaus of the units were made by the same landmark."""
    groups: list[Members] = []
    for number, unit in enumerate(units):
        landmark = np.full(len(unit.view), -1)
        marks = landmarks_of(units, groups)
        if groups and len(unit.view):
            off = Tolerance(
                float(np.sqrt(np.linalg.eigvalsh(unit.covariance[:2, :2])[-1])), float(np.sqrt(unit.covariance[2, 2]))
            )
            landmark = matched(unit.view, np.ones(len(unit.view)), marks, unit.pose[None], off).landmark[0]
        by_members = {tuple(group): group for group in groups}
        taken: set[int] = set()
        for plateau, mark in enumerate(landmark):
            group = by_members[marks.members[mark]] if mark >= 0 else None
            if group is None or id(group) in taken:
                groups.append([(number, plateau)])
            else:
                taken.add(id(group))
                group.append((number, plateau))
    return groups


def adjusted(units: Sequence[PlacedUnit], known: int) -> list[PlacedUnit]:
    """The units with the poses at which their plateaus agree best; those of the first ``known`` keep to what is stated
    of them, within its error.
    """
    groups = [group for group in grouped(units) if len(group) >= _LEAST_SHARED]
    problem = _problem(units, groups, known)
    first = np.concatenate([np.array([one.pose for one in units]).ravel(), problem.landmark.ravel()])
    solved = least_squares(
        problem.residuals, first, x_scale="jac", loss="soft_l1", f_scale=_ROBUST_SIGMAS, max_nfev=_MOST_STEPS
    )
    weak = np.full(len(first), 1e-4)
    covariance = np.linalg.inv(solved.jac.T @ solved.jac + np.diag(weak))
    poses = solved.x[: 3 * len(units)].reshape(-1, 3)
    return [
        one
        if number < known
        else replace(one, pose=poses[number], covariance=covariance[3 * number : 3 * number + 3, 3 * number :][:, :3])
        for number, one in enumerate(units)
    ]


@dataclass(frozen=True)
class _Problem:
    """Plateaus (n,) by unit and landmark, what the known poses are stated to be (known, 3), and the landmarks' first
    values (l, 3): alpha and rho or x and y, and the scale of a point's ranges.
    """

    unit: np.ndarray
    mark: np.ndarray
    is_wall: np.ndarray
    direction_rad: np.ndarray
    direction_sigma_rad: np.ndarray
    range_m: np.ndarray
    range_sigma_m: np.ndarray
    stated: np.ndarray
    stated_sigma: np.ndarray
    landmark: np.ndarray

    def residuals(self, values: np.ndarray) -> np.ndarray:
        """In sigmas, of poses and landmarks in a row."""
        units = len(values) // 3 - len(self.landmark)
        poses, marks = values[: 3 * units].reshape(-1, 3), values[3 * units :].reshape(-1, 3)
        pose, mark = poses[self.unit], marks[self.mark]
        way = mark[:, :2] - pose[:, :2]
        wall_m = mark[:, 1] - pose[:, 0] * np.cos(mark[:, 0]) - pose[:, 1] * np.sin(mark[:, 0])
        bearing_rad = np.where(self.is_wall, mark[:, 0], np.arctan2(way[:, 1], way[:, 0]))
        range_m = np.where(self.is_wall, wall_m, mark[:, 2] * np.hypot(way[:, 0], way[:, 1]))
        off = (poses[: len(self.stated)] - self.stated) / self.stated_sigma
        return np.concatenate(
            [
                wrapped(pose[:, 2] + self.direction_rad - bearing_rad) / self.direction_sigma_rad,
                (self.range_m - range_m) / self.range_sigma_m,
                off.ravel(),
                (marks[:, 2] - 1) / _SCALE_SIGMA,
            ]
        )


def _problem(units: Sequence[PlacedUnit], groups: Sequence[Members], known: int) -> _Problem:
    models = [(wall_model(units, group), point_model(units, group)) for group in groups]
    is_wall = np.array([wall.misfit <= point.misfit for wall, point in models], dtype=bool)
    rows = [(units[unit].view, unit, at, mark) for mark, group in enumerate(groups) for unit, at in group]
    variances = np.array([np.diag(one.covariance) for one in units[:known]]).reshape(-1, 3)
    return _Problem(
        unit=np.array([unit for _, unit, _, _ in rows], dtype=int),
        mark=np.array([mark for *_, mark in rows], dtype=int),
        is_wall=np.array([is_wall[mark] for *_, mark in rows], dtype=bool),
        direction_rad=np.array([view.direction_rad[at] for view, _, at, _ in rows]),
        direction_sigma_rad=np.array([view.direction_sigma_rad[at] for view, _, at, _ in rows]),
        range_m=np.array([view.range_m[at] for view, _, at, _ in rows]),
        range_sigma_m=np.array([view.range_sigma_m[at] for view, _, at, _ in rows]),
        stated=np.array([one.pose for one in units[:known]]).reshape(-1, 3),
        stated_sigma=np.maximum(np.sqrt(variances), (_EXACT_M, _EXACT_M, _EXACT_RAD)),
        landmark=np.array(
            [(*(wall if kind else point).value, 1.0) for (wall, point), kind in zip(models, is_wall, strict=True)]
        ).reshape(-1, 3),
    )
