"""Which units of unknown pose a room can tell the place of: judged by the truth, from labels, by no code of the mapper.

A unit's place can be told when

- it is linked: of the reflectors that it hears, other units hear at least three, a corner between two walls that it
  hears not counted; and a fit of all poses and reflectors at once that is told every label, u1 fixed, knows its pose to
  half of what is wanted (2.5 cm and 1 degree, one sigma); and
- the true arrangement of all units is a thousand times likelier than all rivals together that have it elsewhere
  (``rival_arrangements``). A rival moves any set of units as one, and may need any other room: it does not help a unit
  that it fits its neighbours only where it is, if all of them fit the others elsewhere too. Weighed are at most 60
  rivals, of one rigid motion each, that lose at most two agreements; others are taken for unlikely.

So rectangles, corridors and squares have rivals by their symmetry, nobody has to know it. A move of u1 among the others
is the move of all others, the other way round.
"""

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
from mapper.arrangement import Echo, Reflector, Scene, nearest_heard_m
from mapper.arrangement_worth import DIRECTION_SIGMA_RAD, RANGE_SIGMA_M
from mapper.label_fit import wall_lines
from mapper.rival_arrangements import Rival, rivals
from mapper.room import LabelledSweep, Room

LEAST_READINGS = 5  # by which a reflector is heard, in all sweeps of a unit
LEAST_SHARED = 3
MOST_SIGMA_M, MOST_SIGMA_RAD = 0.025, math.radians(1)
MOST_ODDS = 1 / 1000


def tellable(room: Room, poses: np.ndarray, surveyed: Sequence[LabelledSweep]) -> tuple[str, ...]:
    """The units after u1 whose places the room can tell, by name; ``poses`` (units, 3) are the true ones."""
    linked = _linked(room, poses, _all_heard(room, len(poses), surveyed))
    elsewhere = odds_elsewhere(rivals(scene_of(room, poses, surveyed)), len(poses))
    told = [linked[number] and elsewhere[number] < MOST_ODDS for number in range(len(poses))]
    return tuple(f"u{number + 1}" for number in range(1, len(poses)) if linked[0] and told[number])


def odds_elsewhere(found: Sequence[Rival], units: int) -> np.ndarray:
    """How likely each unit is where rivals have it, beside where it is, (units,)."""
    odds = np.zeros(units)
    for rival in found:
        odds[list(rival.units)] += math.exp(-rival.behind_nats)
    return odds


def scene_of(room: Room, poses: np.ndarray, surveyed: Sequence[LabelledSweep]) -> Scene:
    """The room with all that the units hear for sure."""
    echoes = []
    for pose, heard in zip(poses, _all_heard(room, len(poses), surveyed), strict=True):
        there = echoes_at(room, pose)
        echoes.append({which: there[which] for which in heard if which in there})
    return Scene(room, poses, echoes, nearest_heard_m(surveyed, len(poses)))


def _all_heard(room: Room, units: int, surveyed: Sequence[LabelledSweep]) -> list[set[Reflector]]:
    return [_heard(room, surveyed, f"u{number}") for number in range(1, units + 1)]


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
