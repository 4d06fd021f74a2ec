"""What silence costs an arrangement of units, in nats, and sound that would have gone through walls.

How often a wall is not heard beyond where others touched it, and a point that others hear, is counted from the labels
of 138 simulated rooms. A wall between two feet that are touched is there; sound through it is none, unless there are
two walls that lie on one line by chance.
"""

import math
from collections.abc import Sequence

import numpy as np
from mapper.arrangement import WALL, Group, Scene

BEYOND_M = (0.0, 0.06, 0.25, 0.56, 1.1, 2.0, 3.0)
WALL_SILENT = (0.02, 0.04, 0.13, 0.29, 0.49, 0.77, 0.86)
POINT_SHARES, POINT_SILENT = np.array([1.0, 0.1]), np.array([0.045, 0.8])  # most nearly always answer, a few rarely
NEAREST_M, REACH_M, HEARD_M = 0.1, 3.5, 0.06  # between which a wall always answers, and what is heard at its range
BLIND_M, STUB_M = 0.25, 0.06  # at the end of a sound's way, and of wall beside each foot
THROUGH_NATS = 7.0


def silence_nats(scene: Scene, poses: np.ndarray, groups: Sequence[Group], values: np.ndarray) -> float:
    """What silence and sound through walls cost."""
    cost, segments = 0.0, []
    for group, value in zip(groups, values, strict=True):
        members = {unit for unit, _ in group.members}
        others = [unit for unit in range(len(poses)) if unit not in members]
        wall_chance, point_chance = 1.0, 1.0
        if group.shape.is_wall or len(members) == 1:
            line = value[:2] if group.shape.is_wall else _as_line(scene, poses, group)
            tangent = np.array([-math.sin(line[0]), math.cos(line[0])])
            feet = sorted(float(poses[unit, :2] @ tangent) for unit in members)
            wall_chance = math.prod(1 - _wall_silent(gap) for gap in np.diff(feet))
            wall_chance *= _wall_chance(scene, poses, line, tangent, feet, others)
            if group.shape.is_wall:
                foot = line[1] * np.array([math.cos(line[0]), math.sin(line[0])])
                segments.append((foot + (feet[0] - STUB_M) * tangent, foot + (feet[-1] + STUB_M) * tangent))
        if not group.shape.is_wall or len(members) == 1:
            point = value if not group.shape.is_wall else _as_point(scene, poses, group)
            times = sum(_misses_point(scene, poses, point, unit) for unit in others)
            of_kind = POINT_SHARES * (1 - POINT_SILENT) ** len(members)
            point_chance = float((of_kind * POINT_SILENT**times).sum() / of_kind.sum())
        if len(members) == 1:
            cost -= math.log(WALL.share * wall_chance + (1 - WALL.share) * point_chance)
        else:
            cost -= math.log(wall_chance if group.shape.is_wall else point_chance)
    return cost + THROUGH_NATS * _through(scene, poses, segments)


def _as_line(scene: Scene, poses: np.ndarray, group: Group) -> np.ndarray:
    unit, which = group.members[0]
    echo = scene.echoes[unit][which]
    axis_rad = poses[unit, 2] + echo.direction_rad
    return np.array([axis_rad, poses[unit, :2] @ (math.cos(axis_rad), math.sin(axis_rad)) + echo.range_m])


def _as_point(scene: Scene, poses: np.ndarray, group: Group) -> np.ndarray:
    unit, which = group.members[0]
    echo = scene.echoes[unit][which]
    axis_rad = poses[unit, 2] + echo.direction_rad
    return np.array([*(poses[unit, :2] + echo.range_m * np.array([math.cos(axis_rad), math.sin(axis_rad)])), 1.0, 0.0])


def _wall_silent(beyond_m: float) -> float:
    return float(np.interp(beyond_m, BEYOND_M, WALL_SILENT))


def _wall_chance(
    scene: Scene, poses: np.ndarray, line: np.ndarray, tangent: np.ndarray, feet: Sequence[float], others: Sequence[int]
) -> float:
    """The chance that none of the others hears a wall that was touched at ``feet``: it ends before the nearest."""
    normal, chance, ends = np.array([math.cos(line[0]), math.sin(line[0])]), 1.0, [math.inf, math.inf]
    for unit in others:
        if _is_silent(scene, unit, line[0] - poses[unit, 2], line[1] - normal @ poses[unit, :2]):
            along_m = float(poses[unit, :2] @ tangent)
            beyond_m = feet[0] - along_m, along_m - feet[-1]
            if max(beyond_m) <= 0:
                chance *= WALL_SILENT[0]
            ends = [min(end, beyond) if beyond > 0 else end for end, beyond in zip(ends, beyond_m, strict=True)]
    return chance * math.prod(_wall_silent(end) for end in ends if math.isfinite(end))


def _misses_point(scene: Scene, poses: np.ndarray, point: np.ndarray, unit: int) -> bool:
    way = point[:2] - poses[unit, :2]
    range_m = point[2] * math.hypot(*way) - point[3]
    return _is_silent(scene, unit, math.atan2(way[1], way[0]) - poses[unit, 2], range_m)


def _is_silent(scene: Scene, unit: int, bearing_rad: float, away_m: float) -> bool:
    """Whether the unit looked there and heard nothing so near."""
    nearest_m = scene.nearest_m[unit, round(math.degrees(bearing_rad)) % 360]
    return bool(NEAREST_M < away_m < REACH_M and nearest_m > away_m + HEARD_M)  # False where nobody looked


def _through(scene: Scene, poses: np.ndarray, segments: Sequence[tuple[np.ndarray, np.ndarray]]) -> int:
    """How many walls or echoes must go, those first that are in most ways, until no sound went through a wall."""
    ways = []
    for pose, own in zip(poses, scene.echoes, strict=True):
        for echo in own.values():
            axis_rad = pose[2] + echo.direction_rad
            reach_m = max(echo.range_m - BLIND_M, 0.0)
            ways.append((pose[:2], pose[:2] + reach_m * np.array([math.cos(axis_rad), math.sin(axis_rad)])))
    if not ways or not segments:
        return 0
    a, b = (np.array(each)[:, None] for each in zip(*ways, strict=True))
    c, d = (np.array(each)[None] for each in zip(*segments, strict=True))
    crossed = (_side(c, d, a) * _side(c, d, b) < 0) & (_side(a, b, c) * _side(a, b, d) < 0)
    gone = 0
    while crossed.any():
        of_way, of_wall = crossed.sum(axis=1), crossed.sum(axis=0)
        if of_way.max() > of_wall.max():
            crossed[of_way.argmax()] = False
        else:
            crossed[:, of_wall.argmax()] = False
        gone += 1
    return gone


def _side(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> np.ndarray:
    way, to = end - start, point - start
    return way[..., 0] * to[..., 1] - way[..., 1] * to[..., 0]
