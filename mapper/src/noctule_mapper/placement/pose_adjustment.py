"""Poses of units and landmarks together, by least squares on what all units hear of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks, landmarks_of
from noctule_mapper.placement.pose_scores import Tolerance, matched
from noctule_mapper.placement.reflector_models import (
    NEAR_M,
    POINT_KINDS,
    Members,
    PlacedUnit,
    all_models,
    rows_of,
)
from noctule_mapper.placement.wall_crossings import CORNER_SIGMA_M, corners_at
from noctule_mapper.readings.angles import wrapped

_EXACT_M, _EXACT_RAD = 0.001, np.radians(0.1)  # no stated pose is better
_LEAST_SHARED = 2  # units that hear a landmark, or it tells nothing of their poses
_ROBUST_SIGMAS = 2.0
_STEPS = 5
_WEAK = 1e-4
_NO_CROSSINGS = np.zeros((0, 3), int)


def grouped(
    units: Sequence[PlacedUnit],
    groups: Sequence[Members] = (),
    known: int = 0,
    known_marks: Landmarks | None = None,
) -> tuple[Members, ...]:
    """Which plateaus of the units were made by the same landmark; ``groups`` are those of the first ``known`` units,
    ``known_marks`` their landmarks, if known.
    """
    made = [list(group) for group in groups]
    for number in range(known, len(units)):
        made = _with_plateaus(made, units, number, known_marks if number == known else None)
    return tuple(tuple(group) for group in made)


def regrouped(units: Sequence[PlacedUnit], groups: Sequence[Members]) -> tuple[Members, ...]:
    """The groups after each unit in turn has been told from all others which of its plateaus are whose."""
    for number in range(len(units)):
        others = [[one for one in group if one[0] != number] for group in groups]
        groups = [tuple(sorted(group)) for group in _with_plateaus([one for one in others if one], units, number)]
    return tuple(groups)


def _with_plateaus(
    groups: Sequence[list[tuple[int, int]]],
    units: Sequence[PlacedUnit],
    number: int,
    marks: Landmarks | None = None,
) -> list[list[tuple[int, int]]]:
    """The groups with the plateaus of one more unit; ``marks`` are their landmarks, if known."""
    made, unit = [list(group) for group in groups], units[number]
    landmark = np.full(len(unit.view), -1)
    if made and len(unit.view):
        marks = marks or landmarks_of(units, [tuple(each) for each in made])
        off = Tolerance(
            float(np.sqrt(np.linalg.eigvalsh(unit.covariance[:2, :2])[-1])), float(np.sqrt(unit.covariance[2, 2]))
        )
        best = matched(unit.view, _NO_CROSSINGS, marks, unit.pose[None], off).landmark[0]
        landmark = np.where(best >= 0, marks.group[best], -1)
    for plateau, group in enumerate(landmark):
        if group < 0 or made[group][-1][0] == number:
            made.append([(number, plateau)])
        else:
            made[group].append((number, plateau))
    return made


def adjusted(units: Sequence[PlacedUnit], groups: Sequence[Members], known: int) -> list[PlacedUnit]:
    """The units with the poses at which their plateaus agree best; those of the first ``known`` keep to what is stated
    of them, within its error.
    """
    problem = problem_of(units, groups, known)
    values = np.concatenate([np.array([one.pose for one in units]).ravel(), problem.landmark.ravel()])
    information = np.eye(len(values))
    for _ in range(_STEPS):
        residual, slopes = problem.linearised(values)
        weight = 1 / np.sqrt(1 + (residual / _ROBUST_SIGMAS) ** 2)
        information = slopes.T @ (weight[:, None] * slopes) + _WEAK * np.eye(len(values))
        values = values - np.linalg.solve(information, slopes.T @ (weight * residual))
    covariance = np.linalg.inv(information)
    poses = values[: 3 * len(units)].reshape(-1, 3)
    return [
        one
        if number < known
        else replace(one, pose=poses[number], covariance=covariance[3 * number : 3 * number + 3, 3 * number :][:, :3])
        for number, one in enumerate(units)
    ]


@dataclass(frozen=True)
class Problem:
    """Plateaus (n,) by unit and landmark, what the known poses are stated to be (known, 3), and the landmarks' first
    values (l, 4): alpha and rho or x and y, and k and r of a point's ranges k d - r, with mean and sigma of these two
    beforehand, (l, 2). The landmarks ``corner`` (c,) lie where the two walls ``crossed`` (c, 2) cross.
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
    shape: np.ndarray
    shape_sigma: np.ndarray
    corner: np.ndarray
    crossed: np.ndarray

    def linearised(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals (r,) in sigmas and their slopes by ``values``, poses and landmarks in a row, (r, values)."""
        units = (len(values) - self.landmark.size) // 3
        poses, marks = values[: 3 * units].reshape(-1, 3), values[3 * units :].reshape(-1, 4)
        pose, mark = poses[self.unit], marks[self.mark]
        way = mark[:, :2] - pose[:, :2]
        away_m = np.maximum(np.hypot(way[:, 0], way[:, 1]), NEAR_M)
        cosine, sine = np.cos(mark[:, 0]), np.sin(mark[:, 0])
        wall_m = mark[:, 1] - pose[:, 0] * cosine - pose[:, 1] * sine
        along_m = pose[:, 1] * cosine - pose[:, 0] * sine
        bearing_rad = np.where(self.is_wall, mark[:, 0], np.arctan2(way[:, 1], way[:, 0]))
        range_m = np.where(self.is_wall, wall_m, mark[:, 2] * away_m - mark[:, 3])
        known = 3 * len(self.stated)
        corner, crossed = np.repeat(self.corner, 2), self.crossed.ravel()
        cosine_w, sine_w = np.cos(marks[crossed, 0]), np.sin(marks[crossed, 0])
        beyond_m = marks[corner, 0] * cosine_w + marks[corner, 1] * sine_w - marks[crossed, 1]
        residual = np.concatenate(
            [
                wrapped(pose[:, 2] + self.direction_rad - bearing_rad) / self.direction_sigma_rad,
                (self.range_m - range_m) / self.range_sigma_m,
                ((poses[: len(self.stated)] - self.stated) / self.stated_sigma).ravel(),
                ((marks[:, 2:] - self.shape) / self.shape_sigma).ravel(),
                beyond_m / CORNER_SIGMA_M,
            ]
        )
        n, wall = len(self.unit), self.is_wall
        slopes = np.zeros((len(residual), len(values)))
        of_rad, of_m = np.arange(n), n + np.arange(n)
        of_pose, of_mark = 3 * self.unit, 3 * units + 4 * self.mark
        towards = way / away_m[:, None]
        across = np.stack([-towards[:, 1], towards[:, 0]], axis=1) / away_m[:, None]
        slopes[of_rad, of_pose + 2] = 1 / self.direction_sigma_rad
        normal = np.stack([cosine, sine], axis=1)
        for axis in range(2):
            bearing = np.where(wall, 0.0, across[:, axis]) / self.direction_sigma_rad
            slopes[of_rad, of_pose + axis] = bearing
            slopes[of_rad, of_mark + axis] = -bearing
            slopes[of_m, of_pose + axis] = (
                np.where(wall, normal[:, axis], mark[:, 2] * towards[:, axis]) / self.range_sigma_m
            )
            slopes[of_m, of_mark + axis] = -np.where(wall, 0.0, mark[:, 2] * towards[:, axis]) / self.range_sigma_m
        slopes[of_rad[wall], of_mark[wall]] = -1 / self.direction_sigma_rad[wall]
        slopes[of_m[wall], of_mark[wall]] = along_m[wall] / self.range_sigma_m[wall]
        slopes[of_m[wall], of_mark[wall] + 1] = -1 / self.range_sigma_m[wall]
        slopes[of_m[~wall], of_mark[~wall] + 2] = -away_m[~wall] / self.range_sigma_m[~wall]
        slopes[of_m[~wall], of_mark[~wall] + 3] = 1 / self.range_sigma_m[~wall]
        slopes[2 * n + np.arange(known), np.arange(known)] = 1 / self.stated_sigma.ravel()
        shapes = np.arange(2 * len(self.landmark))
        of_shape = 3 * units + 4 * (shapes // 2) + 2 + shapes % 2
        slopes[2 * n + known + shapes, of_shape] = 1 / self.shape_sigma.ravel()
        last = 2 * n + known + len(shapes) + np.arange(len(crossed))
        of_corner, of_wall = 3 * units + 4 * corner, 3 * units + 4 * crossed
        slopes[last, of_corner] = cosine_w / CORNER_SIGMA_M
        slopes[last, of_corner + 1] = sine_w / CORNER_SIGMA_M
        slopes[last, of_wall] = (marks[corner, 1] * cosine_w - marks[corner, 0] * sine_w) / CORNER_SIGMA_M
        slopes[last, of_wall + 1] = -1 / CORNER_SIGMA_M
        return residual, slopes


def problem_of(units: Sequence[PlacedUnit], groups: Sequence[Members], known: int) -> Problem:
    """The landmarks of those ``groups`` that several plateaus share or that lie at crossings, and the units' poses, to
    be fitted; the first ``known`` poses are stated.
    """
    rows = rows_of(units, groups)
    walls, *points = kinds = all_models(rows)
    at = corners_at(rows, kinds)
    is_fitted = np.bincount(rows.group, minlength=len(groups)) >= _LEAST_SHARED
    is_fitted[at.corner], is_fitted[at.walls] = True, True
    evidence = np.array([one.log_evidence for one in kinds])
    kind = np.argmax(evidence, axis=0) - 1  # -1 of a wall
    kind[at.corner], kind[at.walls] = np.argmax(evidence[1:3, at.corner], axis=0), -1
    kind, number = kind[is_fitted], np.cumsum(is_fitted) - 1
    of_kind, shape_sigma = np.maximum(kind, 0), np.array([(one.scale[1], one.radius_m[1]) for one in POINT_KINDS])
    as_point = np.array([one.value[is_fitted] for one in points])[of_kind, np.arange(len(kind))]
    as_wall = np.column_stack([walls.value[is_fitted], as_point[:, 2:]])
    shape = np.array([(one.scale[0], one.radius_m[0]) for one in POINT_KINDS])
    mark = number[rows.group][is_fitted[rows.group]]
    members = [(units[u].view, u, p) for group, kept in zip(groups, is_fitted, strict=True) if kept for u, p in group]
    variances = np.array([np.diag(one.covariance) for one in units[:known]]).reshape(-1, 3)
    return Problem(
        unit=np.array([unit for _, unit, _ in members], dtype=int),
        mark=mark,
        is_wall=(kind < 0)[mark],
        direction_rad=np.array([view.direction_rad[at] for view, _, at in members]),
        direction_sigma_rad=np.array([view.direction_sigma_rad[at] for view, _, at in members]),
        range_m=np.array([view.range_m[at] for view, _, at in members]),
        range_sigma_m=np.array([view.range_sigma_m[at] for view, _, at in members]),
        stated=np.array([one.pose for one in units[:known]]).reshape(-1, 3),
        stated_sigma=np.maximum(np.sqrt(variances), (_EXACT_M, _EXACT_M, _EXACT_RAD)),
        landmark=np.where(kind[:, None] < 0, as_wall, as_point),
        shape=shape[of_kind],
        shape_sigma=shape_sigma[of_kind],
        corner=number[at.corner],
        crossed=number[at.walls],
    )
