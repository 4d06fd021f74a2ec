"""Rooms with units that stand still, metres apart, each sweeping the fine plan from its place; and what they must find.

A wall is due when two units hear it and a fit that knows every label determines its direction to 1.5 degrees; a corner
of two due walls when it is known to 4 cm; a cylinder when its radius is known to a quarter.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mapper.judge import NEAR_M, alike, corner_errors_m, false_objects, true_wall
from mapper.label_fit import LabelFit, label_fit, variances
from mapper.room import (
    HARD,
    LONGEST_M,
    LabelledSweep,
    Physics,
    Room,
    distance_to_sides_m,
    inside,
    random_room,
    survey_labelled,
)

from noctule_mapper.contour.contour import Contour

BEARINGS_RAD = np.radians(np.linspace(-135, 135, 61))
SWEEPS_EACH = 4
CLEARANCE_M = 0.15  # of a unit from walls and cylinders
# The lobe's half-width in degrees by range in metres, as an HC-SR04's; shares of false, lost and late echoes as HARD's.
LOBE = ((0.0, 20.0), (0.2, 20.0), (0.5, 10.5), (1.5, 9.5), (3.0, 7.0), (LONGEST_M, 5.0))
FIXED = replace(HARD, lobe=LOBE, sigma_position_m=0.0, sigma_heading_rad=0.0)


@dataclass(frozen=True)
class Verdict:
    """What was due, what of it was missed, and what is false, each by a phrase; the errors of the corners that were due
    and found, and those of the fit that knows every label, (n,), in metres.
    """

    due: tuple[str, ...]
    missed: tuple[str, ...]
    false: tuple[str, ...]
    corners_m: np.ndarray
    label_fit_m: np.ndarray


def fixed_room(rng: np.random.Generator, units: int | None = None) -> tuple[Room, np.ndarray]:
    """A random room and the poses of its units, two to six if not told, (units, 3)."""
    room, _ = random_room(rng)
    count = int(rng.integers(2, 7)) if units is None else units
    return room, np.array([pose_in(room, rng) for _ in range(count)])


def survey_fixed(
    room: Room, poses: np.ndarray, rng: np.random.Generator, physics: Physics = FIXED, calibrated: bool = True
) -> list[LabelledSweep]:
    """Each unit's sweeps, the units in turns."""
    rounds = np.tile(poses, (SWEEPS_EACH, 1))
    surveyed = survey_labelled(room, rounds, rng, physics, calibrated, BEARINGS_RAD)
    return [_of_unit(one, number, number % len(poses) + 1) for number, one in enumerate(surveyed)]


def judge_fixed(contour: Contour, room: Room, surveyed: Sequence[LabelledSweep]) -> Verdict:
    """What the contour of ``surveyed`` is worth, by ``room``, in which it was made."""
    told = label_fit(room, surveyed)
    walls, corners, cylinders = _due(room, surveyed, told)
    found_walls = {true_wall(wall, room) for wall in contour.walls}
    errors_m = corner_errors_m(contour, room)
    near = errors_m <= NEAR_M
    missed = [f"wall {i}" for i in np.nonzero(walls)[0] if i not in found_walls]
    missed += [f"corner {i}" for i in np.nonzero(corners & ~near)[0]]
    missed += [
        f"cylinder {i}"
        for i in np.nonzero(cylinders)[0]
        if not any(alike(one, room.cylinders[i]) for one in contour.cylinders)
    ]
    kinds = (("wall", walls), ("corner", corners), ("cylinder", cylinders))
    return Verdict(
        due=tuple(f"{kind} {i}" for kind, due in kinds for i in np.nonzero(due)[0]),
        missed=tuple(missed),
        false=false_objects(contour, room),
        corners_m=errors_m[corners & near],
        label_fit_m=np.hypot(*(told.corners - room.vertices).T)[corners & near],
    )


def _due(room: Room, surveyed: Sequence[LabelledSweep], told: LabelFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    heard_by: list[set[str]] = [set() for _ in room.vertices]
    for one in surveyed:
        for label in one.labels:
            if label.kind == "wall":
                heard_by[label.index].add(one.sweep.unit)
    walls = np.array([len(units) >= 2 for units in heard_by])
    walls &= np.sqrt(variances(told.wall_covariances)[:, 0]) < np.radians(1.5)
    corners = walls & np.roll(walls, 1) & (np.sqrt(variances(told.corner_covariances).sum(axis=1)) < 0.04)
    radii = np.array(room.cylinders).reshape(-1, 3)[:, 2]
    cylinders = np.sqrt(variances(told.cylinder_covariances)[:, 2]) < radii / 4 if len(radii) else np.zeros(0, bool)
    return walls, corners, cylinders


def pose_in(room: Room, rng: np.random.Generator) -> tuple[float, float, float]:
    """A pose anywhere in the room, clear of walls and cylinders."""
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    while True:
        point = rng.uniform(low, high)
        clear = distance_to_sides_m(point, room.vertices).min() > CLEARANCE_M
        clear &= all(math.hypot(point[0] - x, point[1] - y) > r + CLEARANCE_M for x, y, r in room.cylinders)
        if clear and inside(point, room.vertices):
            return float(point[0]), float(point[1]), float(rng.uniform(-np.pi, np.pi))


def _of_unit(one: LabelledSweep, number: int, unit: int) -> LabelledSweep:
    return replace(one, sweep=replace(one.sweep, unit=f"u{unit}", identity=(f"log{unit}", number)))
