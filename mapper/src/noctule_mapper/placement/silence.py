"""What silence tells of a pose, in nats: what the others heard and the unit should hear, what it hears and the others
should, and sound that went through a wall.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView

# How often a wall is not heard whose foot lies so far beyond where others touched it: counted in random rooms with
# units at their true poses.
_BEYOND_M, WALL_SILENT = np.array([0.0, 0.25, 0.5, 1.0, 2.0]), np.array([0.02, 0.08, 0.26, 0.37, 0.5])
THROUGH_NATS = 3.0  # of sound that went through a wall, for each plateau of the unit concerned
_HEARD_M = 0.06
_NEAREST_M, _REACH_M = 0.1, 3.5  # between which a wall always answers
STUB_M = 0.06  # of wall to each side of a foot that is heard
_BLIND_M = 0.25  # at the end of a sound's way that need not be free


@dataclass(frozen=True)
class Surroundings:
    """Ways that sound went freely between a placed unit and what it heard, and pieces of wall there, (s, 2) each; and
    what silence has told already: how far beyond its ends each wall was first not heard (w,), and how many units did
    not hear each point (p,). A wall that is known to end is no surprise the second time.
    """

    way_start_m: np.ndarray
    way_end_m: np.ndarray
    wall_start_m: np.ndarray
    wall_end_m: np.ndarray
    ends_low_m: np.ndarray
    ends_high_m: np.ndarray
    silent_at_point: np.ndarray


def surroundings(units: Sequence[PlacedUnit], marks: Landmarks) -> Surroundings:
    """Of the units, and of the walls between the feet that they touched."""
    parts = [ways_and_stubs(one.view, one.pose[None]) for one in units]
    start, end, left, right = (np.concatenate([part[number][0] for part in parts]) for number in range(4))
    foot, tangent = marks.rho_m[:, None] * unit_vector(marks.alpha_rad), unit_vector(marks.alpha_rad + np.pi / 2)
    low, high = foot + marks.low_m[:, None] * tangent, foot + marks.high_m[:, None] * tangent
    long = marks.high_m - marks.low_m > STUB_M
    ends_low_m, ends_high_m = np.full(len(marks.rho_m), np.inf), np.full(len(marks.rho_m), np.inf)
    silent_at_point = np.zeros(len(marks.point))
    for one in units:
        away_m = marks.rho_m - unit_vector(marks.alpha_rad) @ one.pose[:2]
        silent = is_silent(one.view, marks.alpha_rad - one.pose[2], away_m)
        along_m = tangent @ one.pose[:2]
        for ends_m, beyond_m in ((ends_low_m, marks.low_m - along_m), (ends_high_m, along_m - marks.high_m)):
            nearer = silent & (beyond_m > 0) & (beyond_m < ends_m)
            ends_m[nearer] = beyond_m[nearer]
        bearing_rad, away_m = point_at(marks, one.pose[:2])
        silent_at_point += is_silent(one.view, bearing_rad - one.pose[2], away_m)
    return Surroundings(
        start,
        end,
        np.concatenate([left, low[long]]),
        np.concatenate([right, high[long]]),
        ends_low_m,
        ends_high_m,
        silent_at_point,
    )


def silence_nats(
    view: UnitView,
    marks: Landmarks,
    units: Sequence[PlacedUnit],
    around: Surroundings,
    poses: np.ndarray,
    landmark: np.ndarray,
) -> np.ndarray:
    """What silence costs at ``poses`` (k, 3), (k,); ``landmark`` (k, n) is what explains each plateau, -1 where nothing
    does.
    """
    return (
        _unheard_nats(view, marks, around, poses, landmark)
        + _unheard_by_others_nats(view, units, poses, landmark < 0)
        + _through_nats(view, around, poses)
    )


def _unheard_nats(
    view: UnitView, marks: Landmarks, around: Surroundings, poses: np.ndarray, landmark: np.ndarray
) -> np.ndarray:
    """Of what the others heard and the unit does not."""
    heading_rad = poses[:, None, 2]
    normal, tangent = unit_vector(marks.alpha_rad), unit_vector(marks.alpha_rad + np.pi / 2)
    along_m = poses[:, :2] @ tangent.T
    below_m, above_m = marks.low_m - along_m, along_m - marks.high_m
    silent = np.where(below_m > above_m, _ended(below_m, around.ends_low_m), _ended(above_m, around.ends_high_m))
    away_m = marks.rho_m - poses[:, :2] @ normal.T
    wall = np.where(is_silent(view, marks.alpha_rad - heading_rad, away_m), silent, 1.0)
    bearing_rad, point_m = point_at(marks, poses[:, None, :2])
    often, heard_by = around.silent_at_point, marks.heard_by[len(normal) :]
    once_more = point_silent(often + 1, heard_by) / point_silent(often, heard_by)
    point = np.where(is_silent(view, bearing_rad - heading_rad, point_m), once_more, 1.0)
    groups, walls = int(marks.group.max(initial=-1)) + 1, len(marks.alpha_rad)
    of_wall = marks.chance[:walls] * silent_beyond(around.ends_low_m) * silent_beyond(around.ends_high_m)
    of_point = marks.chance[walls:] * point_silent(often, heard_by)
    chance, total = np.zeros((len(poses), groups)), np.zeros(groups)
    chance[:, marks.group[:walls]] = of_wall * wall
    total[marks.group[:walls]] = of_wall
    of_point = np.where(heard_by > 0, of_point, 0.0)  # who knows whether there is a corner that nobody has heard
    each = np.concatenate([of_point[None], of_point * point])
    summed = each @ (marks.group[walls:, None] == np.arange(groups))
    total += summed[0]
    chance += summed[1:]
    heard = np.zeros((len(poses), groups + 1), bool)
    of_landmark = np.where(landmark >= 0, marks.group[landmark], groups)
    np.put_along_axis(heard, of_landmark, True, axis=1)
    unheard = ~heard[:, :groups] & (total > 0)
    return -np.log(np.where(unheard, chance / np.where(total > 0, total, 1.0), 1.0)).sum(axis=1)


def point_at(marks: Landmarks, place_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Direction and range of each point from ``place_m`` (..., 2), (..., p)."""
    way = marks.point[:, :2] - place_m
    range_m = marks.point[:, 2] * np.hypot(way[..., 0], way[..., 1]) - marks.point[:, 3]
    return np.arctan2(way[..., 1], way[..., 0]), range_m


def _unheard_by_others_nats(
    view: UnitView, units: Sequence[PlacedUnit], poses: np.ndarray, own: np.ndarray
) -> np.ndarray:
    """Of what the unit alone hears, ``own`` (k, n), and the others do not; a wall or a point, who knows."""
    direction_rad = poses[:, 2, None] + view.direction_rad
    normal = unit_vector(direction_rad)
    foot = poses[:, None, :2] + view.range_m[:, None] * normal
    left_m, right_m, silent_at_point = np.full(own.shape, np.inf), np.full(own.shape, np.inf), np.zeros(own.shape)
    for unit in units:
        way = foot - unit.pose[:2]
        away_m = (way * normal).sum(axis=-1)
        along_m = way[..., 0] * normal[..., 1] - way[..., 1] * normal[..., 0]
        silent = is_silent(unit.view, direction_rad - unit.pose[2], away_m)
        left_m = np.where(silent & (along_m >= 0), np.minimum(left_m, along_m), left_m)
        right_m = np.where(silent & (along_m < 0), np.minimum(right_m, -along_m), right_m)
        bearing_rad = np.arctan2(way[..., 1], way[..., 0]) - unit.pose[2]
        silent_at_point += is_silent(unit.view, bearing_rad, np.hypot(way[..., 0], way[..., 1]))
    chance = (silent_beyond(left_m) * silent_beyond(right_m) + point_silent(silent_at_point, 1)) / 2
    return -np.where(own, np.log(chance), 0.0).sum(axis=1)


def silent_beyond(beyond_m: np.ndarray) -> np.ndarray:
    """The chance that a wall is not heard so far beyond an end; 1 where it was heard (infinite)."""
    return np.where(np.isinf(beyond_m), 1.0, np.interp(beyond_m, _BEYOND_M, WALL_SILENT))


def _ended(beyond_m: np.ndarray, ends_m: np.ndarray) -> np.ndarray:
    """The same of a wall that was not heard ``ends_m`` beyond its end."""
    known = np.interp(ends_m, _BEYOND_M, WALL_SILENT)
    silent = np.interp(np.maximum(beyond_m, 0), _BEYOND_M, WALL_SILENT)
    return np.where(np.isinf(ends_m), silent, np.minimum(silent / known, 1.0))


def point_silent(times: np.ndarray, heard_by: np.ndarray | int) -> np.ndarray:
    """The chance that a point that ``heard_by`` units hear is not heard by so many others, all of which should."""
    of_kind = _POINT_SHARES * (1 - _POINT_SILENT) ** np.asarray(heard_by)[..., None]
    silent = (of_kind * _POINT_SILENT ** times[..., None]).sum(axis=-1)
    return silent / of_kind.sum(axis=-1)


# Counted in 138 random rooms with units at their true poses (the test has the counts): most points answer nearly
# always, a few hardly ever.
_POINT_SHARES, _POINT_SILENT = np.array([1.0, 0.1]), np.array([0.045, 0.8])


def is_silent(view: UnitView, bearing_rad: np.ndarray, away_m: np.ndarray) -> np.ndarray:
    """Where the unit looked and heard nothing so near, though what is there should answer."""
    nearest_m = view.nearest_at(bearing_rad)
    due = (away_m > _NEAREST_M) & (away_m < _REACH_M)
    return due & (nearest_m > away_m + _HEARD_M)  # False where nobody looked


def _through_nats(view: UnitView, around: Surroundings, poses: np.ndarray) -> np.ndarray:
    """Plateaus of the unit that stand in the way of what others heard, or behind walls."""
    start, end, left, right = ways_and_stubs(view, poses)
    blocked = _cross(start, end, around.wall_start_m, around.wall_end_m)
    blocking = _cross(left, right, around.way_start_m, around.way_end_m)
    return THROUGH_NATS * (blocked | blocking).sum(axis=1)


def ways_and_stubs(view: UnitView, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Ends of the ways to what the unit hears, and of the pieces of wall there, (k, n, 2) each."""
    towards = unit_vector(poses[:, 2, None] + view.direction_rad)
    across = np.stack([-towards[..., 1], towards[..., 0]], axis=-1)
    start = np.broadcast_to(poses[:, None, :2], towards.shape)
    foot = start + view.range_m[:, None] * towards
    return start, foot - _BLIND_M * towards, foot - STUB_M * across, foot + STUB_M * across


def _cross(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Which of the segments a-b (k, n, 2) cross one of the segments c-d (s, 2), (k, n)."""
    if not len(c):
        return np.zeros(a.shape[:2], bool)
    a, b = a[:, :, None], b[:, :, None]
    first = side(c, d, a) * side(c, d, b) < 0
    return np.any(first & (side(a, b, c) * side(a, b, d) < 0), axis=-1)


def side(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> np.ndarray:
    way, to = end - start, point - start
    return way[..., 0] * to[..., 1] - way[..., 1] * to[..., 0]


def unit_vector(angle_rad: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(angle_rad), np.sin(angle_rad)], axis=-1)
