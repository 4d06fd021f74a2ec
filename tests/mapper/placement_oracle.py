"""Which units of unknown pose a room can tell the place of: judged by the truth, from labels, by no code of the mapper.

A unit's place can be told when

- it is linked: of the reflectors that it hears, other units hear at least three, a corner between two walls that it
  hears not counted; and a fit of all poses and reflectors at once that is told every label, u1 fixed, knows its pose to
  half of what is wanted (2.5 cm and 1 degree, one sigma); and
- it has no rival: at no other place in the room, with any heading, would it hear the same but for one discrepancy.
  A discrepancy is a shared reflector without a counterpart there (within 3 cm and 4 degrees), or a wall there that it
  should hear and does not. One discrepancy is a hidden wall, or a wall that nobody else has heard; two are not chance.
  The rivals tried are all poses at which two of its echoes, not parallel, fall on two reflectors of the room.

Nor can any place be told if u1, the only one whose pose is given, would not be found among the others.

So rectangles, corridors and squares have rivals by their symmetry, nobody has to know it.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from mapper.fixed_units import BEARINGS_RAD
from mapper.label_fit import wall_lines
from mapper.room import LONGEST_M, LabelledSweep, Room, distance_to_sides_m, inside

LEAST_READINGS = 5  # by which a reflector is heard, in all sweeps of a unit
LEAST_SHARED = 3
MOST_SIGMA_M, MOST_SIGMA_RAD = 0.025, math.radians(1)
DIRECTION_SIGMA_RAD, RANGE_SIGMA_M = math.radians(1.1), 0.002  # of one reflector as one unit hears it
ALIKE_M, ALIKE_RAD = 0.03, math.radians(4)
ELSEWHERE_M, ELSEWHERE_RAD = 0.15, math.radians(6)
MOST_DISCREPANCIES = 1
SURE_REACH_M = 3.5  # within which a wall always answers
CLEAR_OF_WALLS_M = 0.1

Reflector = tuple[str, int]  # kind, number


@dataclass(frozen=True)
class Echo:
    """Where a reflector is heard: its direction in the unit's frame, and its range."""

    direction_rad: float
    range_m: float


def tellable(room: Room, poses: np.ndarray, surveyed: Sequence[LabelledSweep]) -> tuple[str, ...]:
    """The units after u1 whose places the room can tell, by name; ``poses`` (units, 3) are the true ones."""
    heard = [_heard(room, surveyed, f"u{number}") for number in range(1, len(poses) + 1)]
    linked = _linked(room, poses, heard)
    told = [linked[number] and not _has_rival(room, pose, *_shared(heard, number)) for number, pose in enumerate(poses)]
    return tuple(f"u{number + 1}" for number in range(1, len(poses)) if told[0] and told[number])


def _heard(room: Room, surveyed: Sequence[LabelledSweep], unit: str) -> set[Reflector]:
    """What the unit hears for sure, but for corners of walls that it hears."""
    count = Counter(
        (label.kind, label.index)
        for one in surveyed
        if one.sweep.unit == unit
        for label in one.labels
        if label.index >= 0
    )
    heard: set[Reflector] = {which for which, readings in count.items() if readings >= LEAST_READINGS}
    walls = len(room.vertices)
    implied = {
        (kind, number)
        for kind, number in heard
        if kind in ("corner", "edge") and {("wall", number), ("wall", (number - 1) % walls)} <= heard
    }
    return heard - implied


def _shared(heard: Sequence[set[Reflector]], number: int) -> tuple[set[Reflector], set[Reflector]]:
    """What a unit hears that others hear too, and all it hears."""
    others = set().union(*(each for other, each in enumerate(heard) if other != number))
    return heard[number] & others, heard[number]


def _linked(room: Room, poses: np.ndarray, heard: Sequence[set[Reflector]]) -> list[bool]:
    """Whether a fit told every label knows each unit's pose, u1 known."""
    counts = Counter(which for each in heard for which in each)
    numbers = {which: at for at, which in enumerate(which for which, units in counts.items() if units > 1)}
    size = 3 * len(poses) + 2 * len(numbers)
    information = np.diag([1e9] * 3 + [1e-6] * (size - 3))
    lines = wall_lines(room)
    for unit, (pose, each) in enumerate(zip(poses, heard, strict=True)):
        for which in each & set(numbers):
            rows = np.zeros((2, size))
            of_pose, of_mark = _slopes(room, lines, pose, which)
            rows[:, 3 * unit : 3 * unit + 3] = of_pose
            first = 3 * len(poses) + 2 * numbers[which]
            rows[:, first : first + 2] = of_mark
            rows /= np.array([[DIRECTION_SIGMA_RAD], [RANGE_SIGMA_M]])
            information += rows.T @ rows
    covariance = np.linalg.inv(information)
    linked = []
    for unit in range(len(poses)):
        own = covariance[3 * unit : 3 * unit + 3, 3 * unit : 3 * unit + 3]
        sigma_m = math.sqrt(np.linalg.eigvalsh(own[:2, :2])[-1])
        enough = len(heard[unit] & set(numbers)) >= LEAST_SHARED
        linked.append(enough and sigma_m < MOST_SIGMA_M and math.sqrt(own[2, 2]) < MOST_SIGMA_RAD)
    return linked


def _slopes(room: Room, lines: np.ndarray, pose: np.ndarray, which: Reflector) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of a reflector's direction and range by the pose (2, 3) and by the reflector: a wall's direction and
    distance, else a point's place (2, 2).
    """
    kind, number = which
    if kind == "wall":
        normal = np.array([math.cos(lines[number, 0]), math.sin(lines[number, 0])])
        along_m = float(pose[:2] @ (-normal[1], normal[0]))
        return np.array([[0, 0, -1], [-normal[0], -normal[1], 0]]), np.array([[1, 0], [-along_m, 1]])
    way = (np.array(room.cylinders[number][:2]) if kind == "cylinder" else room.vertices[number]) - pose[:2]
    away_m = math.hypot(*way)
    towards = way / away_m
    across = np.array([-towards[1], towards[0]]) / away_m
    return np.array([[*-across, -1], [*-towards, 0]]), np.array([across, towards])


def echoes_at(room: Room, pose: np.ndarray) -> dict[Reflector, Echo]:
    """Every reflector that a unit may hear at ``pose``, whatever hides it."""
    echoes: dict[Reflector, Echo] = {}
    side = room.ends - room.vertices
    for number, (start, along) in enumerate(zip(room.vertices, side, strict=True)):
        share = float((pose[:2] - start) @ along / (along @ along))
        if 0 <= share <= 1:
            echoes["wall", number] = _echo(pose, start + share * along)
    for number, corner in enumerate(room.vertices):
        angle_rad = room.interior_rad[number]
        kind = "edge" if angle_rad > np.pi else "corner"
        factor = math.sin(angle_rad) if angle_rad < np.pi / 2 else 1.0
        echoes[kind, number] = _echo(pose, corner, factor)
    for number, (x_m, y_m, radius_m) in enumerate(room.cylinders):
        away_m = math.hypot(x_m - pose[0], y_m - pose[1])
        echoes["cylinder", number] = _echo(pose, np.array([x_m, y_m]), 1 - radius_m / max(away_m, radius_m))
    return echoes


def _echo(pose: np.ndarray, point: np.ndarray, factor: float = 1.0) -> Echo:
    way = point - pose[:2]
    return Echo(math.remainder(math.atan2(way[1], way[0]) - pose[2], math.tau), factor * math.hypot(*way))


def _has_rival(room: Room, true: np.ndarray, shared: set[Reflector], heard: set[Reflector]) -> bool:
    at_truth = echoes_at(room, true)
    echoes = [at_truth[which] for which in heard if which in at_truth]
    telling = [at_truth[which] for which in shared if which in at_truth]
    return any(
        _discrepancies(room, pose, telling, echoes) <= MOST_DISCREPANCIES
        for pose in _candidates(room, telling)
        if _is_elsewhere(pose, true)
        and inside(pose[:2], room.vertices)
        and distance_to_sides_m(pose[:2], room.vertices).min() > CLEAR_OF_WALLS_M
    )


def _is_elsewhere(pose: np.ndarray, true: np.ndarray) -> bool:
    off_rad = abs(math.remainder(pose[2] - true[2], math.tau))
    return math.hypot(*(pose - true)[:2]) > ELSEWHERE_M or off_rad > ELSEWHERE_RAD


def _candidates(room: Room, echoes: Sequence[Echo]) -> list[np.ndarray]:
    """Poses at which two of the echoes are of two walls of the room."""
    lines = wall_lines(room)
    poses = []
    for first, second in permutations(echoes, 2):
        for one, other in permutations(range(len(lines)), 2):
            apart_rad = second.direction_rad - first.direction_rad
            turned_rad = lines[other, 0] - lines[one, 0]
            if abs(math.sin(turned_rad)) < 0.2 or abs(math.remainder(apart_rad - turned_rad, math.tau)) > ALIKE_RAD:
                continue
            normals = np.stack([np.cos(lines[[one, other], 0]), np.sin(lines[[one, other], 0])], axis=1)
            place = np.linalg.solve(normals, lines[[one, other], 1] - (first.range_m, second.range_m))
            poses.append(np.array([*place, lines[one, 0] - first.direction_rad]))
    return poses


def _discrepancies(room: Room, pose: np.ndarray, telling: Sequence[Echo], echoes: Sequence[Echo]) -> int:
    """Echoes that have no counterpart at ``pose``, and walls there, in plain sight, that have none among the echoes."""
    there = echoes_at(room, pose)
    count = sum(not any(_are_alike(one, other) for other in there.values()) for one in telling)
    for (kind, _), echo in there.items():
        due = kind == "wall" and echo.range_m < min(SURE_REACH_M, LONGEST_M)
        due = due and abs(echo.direction_rad) < BEARINGS_RAD[-1] and _is_in_sight(room, pose, echo)
        count += due and not any(_are_alike(one, echo) for one in echoes)
    return int(count)


def _are_alike(one: Echo, other: Echo) -> bool:
    off_rad = abs(math.remainder(one.direction_rad - other.direction_rad, math.tau))
    return abs(one.range_m - other.range_m) < ALIKE_M and off_rad < ALIKE_RAD


def _is_in_sight(room: Room, pose: np.ndarray, echo: Echo) -> bool:
    """Whether no wall and no cylinder stands between."""
    bearing_rad = pose[2] + echo.direction_rad
    towards = np.array([math.cos(bearing_rad), math.sin(bearing_rad)])
    points = pose[:2] + np.linspace(0, 0.98 * echo.range_m, 40)[:, None] * towards
    clear = all(inside(point, room.vertices) for point in points)
    return clear and all(np.hypot(*(points - (x, y)).T).min() > radius for x, y, radius in room.cylinders)
