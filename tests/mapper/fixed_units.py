"""Rooms with units that stand still, metres apart, each sweeping the fine plan from its place; and what they must find.

A wall is due when two units hear it and a fit that knows every label determines its direction to 1.5 degrees; a corner
of two due walls when it is known to 4 cm; a cylinder when its radius is known to a quarter, which may be 11 cm. So a
cylinder that is due is found within three sigmas of that fit, at least 5 and at most 10 cm. Of a unit that is alone in
a rectangular room each wall is due whose foot lies inside its sweep and within 3.5 m.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mapper.judge import NEAR_M, alike, corner_errors_m, false_objects, true_wall
from mapper.label_fit import LabelFit, label_fit, variances, wall_lines
from mapper.room import (
    HARD,
    LONGEST_M,
    Label,
    LabelledSweep,
    Physics,
    Room,
    distance_to_sides_m,
    inside,
    random_room,
    survey_labelled,
)

from noctule import messages_pb2
from noctule.air import speed_of_sound_m_s
from noctule_mapper.config import SensorConfig
from noctule_mapper.contour.contour import Contour, Wall
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.looks import Pose, pose_of
from noctule_mapper.readings.sweep import from_message

BEARINGS_RAD = np.radians(np.linspace(-135, 135, 61))
SWEEPS_EACH = 4
CLEARANCE_M = 0.15  # of a unit from walls and cylinders
# The lobe's half-width in degrees by range in metres, as an HC-SR04's; shares of false, lost and late echoes as HARD's.
LOBE = ((0.0, 20.0), (0.2, 20.0), (0.5, 10.5), (1.5, 9.5), (3.0, 7.0), (LONGEST_M, 5.0))
ALONE_REACH_M = 3.5  # of a unit that is alone: the wall of a farther foot is not due
ALONE_NORMAL_RAD, ALONE_DISTANCE_M = math.radians(2), 0.01  # how well it must know a wall
FIXED = replace(HARD, lobe=LOBE, sigma_position_m=0.0, sigma_heading_rad=0.0)
FAR_M = 0.1  # at most, a cylinder is found so far from where it is
TAPE_M, TAPE_RAD = 0.03, math.radians(3)  # what a tape measure and the eye err by


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


def rectangular_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """A rectangular room of 3 to 5 m, turned at random, and the pose of one unit anywhere in it, (1, 3)."""
    width, depth = rng.uniform(3, 5, 2)
    turn, centre = rng.uniform(-np.pi, np.pi), rng.uniform(-2, 2, 2)
    turned = np.array([(math.cos(turn), math.sin(turn)), (-math.sin(turn), math.cos(turn))])
    room = Room(np.array([(0, 0), (width, 0), (width, depth), (0, depth)]) @ turned + centre)
    return room, np.array([pose_in(room, rng)])


def survey_to_and_fro(
    room: Room, pose: np.ndarray, rng: np.random.Generator, play_rad: float, physics: Physics = FIXED
) -> list[LabelledSweep]:
    """The sweeps of one unit, ``pose`` (1, 3), whose gears have some play: they alternate, the first anticlockwise. A
    bearing that is reached anticlockwise is stated too large by half of the play, else too small by as much.
    """
    sweeps = []
    for number in range(SWEEPS_EACH):
        sense = 1 if number % 2 == 0 else -1
        true = pose - (0, 0, sense * play_rad / 2)
        (one,) = survey_labelled(room, true, rng, physics, True, BEARINGS_RAD)
        sweep = replace(one.sweep, heading_rad=float(pose[0, 2]))
        if sense < 0:
            backwards = {name: getattr(sweep, name)[::-1] for name in ("bearing_rad", "range_m", "no_echo")}
            sweep = replace(sweep, **backwards)
        sweeps.append(_of_unit(replace(one, sweep=sweep, labels=one.labels[::sense]), number, 1))
    return sweeps


def due_alone(room: Room, pose: np.ndarray) -> dict[int, tuple[float, float]]:
    """Which walls are due to a unit alone at ``pose`` (3,): direction and distance of each."""
    due = {}
    for number, (start, end) in enumerate(zip(room.vertices, room.ends, strict=True)):
        along = (end - start) / np.hypot(*(end - start))
        normal_rad = math.atan2(-along[0], along[1])  # out of the room
        distance_m = float((start - pose[:2]) @ (along[1], -along[0]))
        foot_is_on_it = 0 <= (pose[:2] - start) @ along <= np.hypot(*(end - start))
        in_sweep = abs(wrapped(np.array(normal_rad - pose[2]))) <= BEARINGS_RAD[-1]
        if foot_is_on_it and in_sweep and distance_m <= ALONE_REACH_M:
            due[number] = (normal_rad, distance_m)
    return due


def found_alone(contour: Contour, room: Room, pose: np.ndarray) -> list[int]:
    """Which of the walls that are due to a unit alone its contour has, well enough."""
    return [
        number
        for number, (normal_rad, distance_m) in due_alone(room, pose).items()
        if any(_good_alone(wall, normal_rad, distance_m, pose) for wall in contour.walls)
    ]


def _good_alone(wall: Wall, normal_rad: float, distance_m: float, pose: np.ndarray) -> bool:
    off_rad = abs(wrapped(np.array(wall.theta_rad - normal_rad)))
    off_m = abs(wall.rho_m - wall.normal @ pose[:2] - distance_m)
    return bool(off_rad <= ALONE_NORMAL_RAD and off_m <= ALONE_DISTANCE_M)


def survey_fixed(
    room: Room, poses: np.ndarray, rng: np.random.Generator, physics: Physics = FIXED, calibrated: bool = True
) -> list[LabelledSweep]:
    """Each unit's sweeps, the units in turns."""
    rounds = np.tile(poses, (SWEEPS_EACH, 1))
    surveyed = survey_labelled(room, rounds, rng, physics, calibrated, BEARINGS_RAD)
    return [_of_unit(one, number, number % len(poses) + 1) for number, one in enumerate(surveyed)]


def unmeasured(rng: np.random.Generator, celsius: float) -> Physics:
    """A sensor that nobody has measured, in air of ``celsius``: its mean error and its face's offset are drawn as the
    mapper assumes them of such.
    """
    assumed = SensorConfig()
    return replace(
        FIXED,
        bias_m=float(rng.normal(0, assumed.bias_sigma_m)),
        face_offset_m=float(rng.normal(assumed.face_offset_m, assumed.assumed_face_sigma_m)),
        range_scale=speed_of_sound_m_s(assumed.air_temperature_c) / speed_of_sound_m_s(celsius),
    )


def survey_by_unmeasured(
    room: Room,
    poses: np.ndarray,
    rng: np.random.Generator,
    sensors: Sequence[Physics],
    states: SensorConfig | None = None,
) -> list[LabelledSweep]:
    """As survey_fixed(), each unit with a sensor of ``sensors`` of its own, and every sweep as unsure of it as one that
    says nothing, or as ``states`` is.
    """
    blank = messages_pb2.Sweep()
    blank.pose.SetInParent()
    said = from_message(blank, states)
    unsure = {
        name: getattr(said, name) for name in ("sigma_bias_m", "face_offset_m", "face_offset_sigma_m", "sigma_scale")
    }
    by_unit = [
        [
            replace(
                one,
                sweep=replace(one.sweep, unit=f"u{number}", range_m=one.sweep.range_m + said.face_offset_m, **unsure),
            )
            for one in survey_fixed(room, pose[None], rng, sensor)
        ]
        for number, (pose, sensor) in enumerate(zip(poses, sensors, strict=True), start=1)
    ]
    return [
        replace(one, sweep=replace(one.sweep, identity=("room", len(poses) * turn + unit)))
        for turn, each in enumerate(zip(*by_unit, strict=True))
        for unit, one in enumerate(each)
    ]


def survey_with_people(
    room: Room, poses: np.ndarray, rng: np.random.Generator, people: int, rounds: int = SWEEPS_EACH
) -> tuple[list[LabelledSweep], np.ndarray]:
    """As survey_fixed(), with ``people`` who stand elsewhere in each round of the units, and where they stood, (n, 2);
    a label calls them false.
    """
    surveyed: list[LabelledSweep] = []
    stood: list[tuple[float, float, float]] = []
    for _ in range(rounds):
        here = [_person(room, poses, rng) for _ in range(people)]
        stood += here
        crowded = replace(room, cylinders=(*room.cylinders, *here))
        for one in survey_labelled(crowded, poses, rng, FIXED, True, BEARINGS_RAD):
            number = len(surveyed)
            timed = replace(one, sweep=replace(one.sweep, time_s=3.0 * number))
            unit = _of_unit(timed, number, number % len(poses) + 1)
            surveyed.append(replace(unit, labels=tuple(_of_the_room(label, room) for label in one.labels)))
    return surveyed, np.array(stood)[:, :2]


PERSON_RADIUS_M = 0.2


def _person(room: Room, poses: np.ndarray, rng: np.random.Generator) -> tuple[float, float, float]:
    """Someone on their feet, clear of walls, cylinders and units."""
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    while True:
        point = rng.uniform(low, high)
        clear = distance_to_sides_m(point, room.vertices).min() > PERSON_RADIUS_M + 0.05
        clear &= bool(np.hypot(*(poses[:, :2] - point).T).min() > PERSON_RADIUS_M + CLEARANCE_M)
        clear &= all(math.hypot(point[0] - x, point[1] - y) > r + PERSON_RADIUS_M for x, y, r in room.cylinders)
        if clear and inside(point, room.vertices):
            return float(point[0]), float(point[1]), PERSON_RADIUS_M


def _of_the_room(label: Label, room: Room) -> Label:
    person = label.kind == "cylinder" and label.index >= len(room.cylinders)
    return Label("false") if person else label


def stated_by_tape(
    surveyed: Sequence[LabelledSweep], poses: np.ndarray, sigma_m: float = TAPE_M, sigma_rad: float = TAPE_RAD
) -> list[LabelledSweep]:
    """The survey with the units stated to be at ``poses`` (units, 3), to within a tape measure's error."""
    return [
        replace(
            one,
            sweep=replace(
                one.sweep,
                x_m=float(x_m),
                y_m=float(y_m),
                heading_rad=float(heading_rad),
                sigma_position_m=sigma_m,
                sigma_heading_rad=sigma_rad,
            ),
        )
        for one in surveyed
        for x_m, y_m, heading_rad in [poses[int(one.sweep.unit[1:]) - 1]]
    ]


def taped_room(rng: np.random.Generator, units: int | None = None) -> tuple[Room, np.ndarray, list[LabelledSweep]]:
    """A random room, the true poses of its units (units, 3) and their sweeps, with poses stated by tape measure."""
    room, stated = fixed_room(rng, units)
    true = stated + rng.normal(0, 1, stated.shape) * (TAPE_M, TAPE_M, TAPE_RAD)
    return room, true, stated_by_tape(survey_fixed(room, true, rng), stated)


def room_can_tell(room: Room, surveyed: Sequence[LabelledSweep], wrong: set[str]) -> bool:
    """Whether each of the ``wrong`` units hears three walls, not all parallel, that right ones hear, and two walls each
    of at least two of these.
    """
    heard: dict[str, set[int]] = {}
    for one in surveyed:
        walls = {label.index for label in one.labels if label.kind == "wall"}
        heard[one.sweep.unit] = heard.get(one.sweep.unit, set()) | walls
    theta = wall_lines(room)[:, 0]
    right = [heard[unit] for unit in heard if unit not in wrong]
    for unit in wrong:
        shared = sorted(heard[unit] & set().union(*right))
        turned = max((abs(math.sin(theta[i] - theta[j])) for i in shared for j in shared), default=0.0)
        if len(shared) < 3 or turned < 0.3 or sum(len(heard[unit] & each) >= 2 for each in right) < 2:
            return False
    return True


def aligned(contour: Contour, room: Room, true: np.ndarray) -> Contour:
    """The contour moved as a whole so that it fits ``room`` best: the frame of poses stated by tape measure is nowhere
    exact. It begins with the ``true`` poses (units, 3) of the units.
    """
    lines = wall_lines(room)
    for gate_m in (0.5, 0.3, 0.15, 0.1, NEAR_M, NEAR_M):
        equations = [
            *_corners_meet(contour, room, gate_m),
            *_walls_meet(contour, room, lines, gate_m),
            *_poses_meet(contour, true, 1.0 if gate_m == 0.5 else 0.1),
        ]
        dx_m, dy_m, turn_rad = np.linalg.lstsq(*map(np.array, zip(*equations, strict=True)), rcond=None)[0]
        contour = turned(contour, turn_rad).shifted(dx_m, dy_m)
    return contour


_Equation = tuple[np.ndarray, float]  # what a shift along x, one along y and a turn add up to


def _lies_at(x_m: float, y_m: float, theta_rad: float, rho_m: float, weight: float = 1.0) -> _Equation:
    """The point, moved, lies at ``rho_m`` in the direction ``theta_rad``."""
    along, across = math.cos(theta_rad), math.sin(theta_rad)
    row = weight * np.array([along, across, across * x_m - along * y_m])
    return row, weight * (rho_m - along * x_m - across * y_m)


def _corners_meet(contour: Contour, room: Room, gate_m: float) -> Iterator[_Equation]:
    for corner in contour.corners:
        away_m = np.hypot(*(room.vertices - (corner.x_m, corner.y_m)).T)
        if away_m.min() < gate_m:
            x_m, y_m = room.vertices[away_m.argmin()]
            yield _lies_at(corner.x_m, corner.y_m, 0.0, x_m)
            yield _lies_at(corner.x_m, corner.y_m, math.pi / 2, y_m)


def _walls_meet(contour: Contour, room: Room, lines: np.ndarray, gate_m: float) -> Iterator[_Equation]:
    for wall in contour.walls:
        away_m = np.maximum(*(distance_to_sides_m(np.array(end), room.vertices) for end in (wall.start, wall.end)))
        if away_m.min() < gate_m:
            theta_rad, rho_m = lines[away_m.argmin()]
            for x_m, y_m in (wall.start, wall.end):
                yield _lies_at(x_m, y_m, theta_rad, rho_m)


def _poses_meet(contour: Contour, true: np.ndarray, weight: float) -> Iterator[_Equation]:
    for pose in contour.poses:
        x_m, y_m, heading_rad = true[int(pose.unit[1:]) - 1]
        if not pose.is_wrong:
            yield _lies_at(pose.x_m, pose.y_m, 0.0, x_m, weight)
            yield _lies_at(pose.x_m, pose.y_m, math.pi / 2, y_m, weight)
            turn_rad = float(wrapped(np.array(heading_rad - pose.heading_rad)))
            yield np.array([0.0, 0.0, weight]), weight * turn_rad


def turned(contour: Contour, turn_rad: float) -> Contour:
    """The contour turned about the origin; covariances stay as they are."""
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)

    def point(x_m: float, y_m: float) -> tuple[float, float]:
        return cosine * x_m - sine * y_m, sine * x_m + cosine * y_m

    def placed(one: Any) -> Any:
        x_m, y_m = point(one.x_m, one.y_m)
        return replace(one, x_m=x_m, y_m=y_m)

    return replace(
        contour,
        walls=tuple(
            replace(one, theta_rad=one.theta_rad + turn_rad, start=point(*one.start), end=point(*one.end))
            for one in contour.walls
        ),
        corners=tuple(map(placed, contour.corners)),
        cylinders=tuple(map(placed, contour.cylinders)),
        poses=tuple(replace(placed(one), heading_rad=one.heading_rad + turn_rad) for one in contour.poses),
    )


def judge_fixed(
    contour: Contour, room: Room, surveyed: Sequence[LabelledSweep], told: LabelFit | None = None
) -> Verdict:
    """What the contour of ``surveyed`` is worth, by ``room``, in which it was made, and beside ``told``, the fit that
    knows every label: of exact poses if not given.
    """
    told = label_fit(room, surveyed) if told is None else told
    walls, corners, cylinders = _due(room, surveyed, told)
    found_walls = {true_wall(wall, room) for wall in contour.walls}
    errors_m = corner_errors_m(contour, room)
    near, cylinders_near_m = errors_m <= NEAR_M, cylinders_near_m_of(told, cylinders)
    missed = [f"wall {i}" for i in np.nonzero(walls)[0] if i not in found_walls]
    missed += [f"corner {i}" for i in np.nonzero(corners & ~near)[0]]
    missed += [
        f"cylinder {i}"
        for i in np.nonzero(cylinders)[0]
        if not any(alike(one, room.cylinders[i], cylinders_near_m[i]) for one in contour.cylinders)
    ]
    kinds = (("wall", walls), ("corner", corners), ("cylinder", cylinders))
    return Verdict(
        due=tuple(f"{kind} {i}" for kind, due in kinds for i in np.nonzero(due)[0]),
        missed=tuple(missed),
        false=false_objects(contour, room, cylinders_near_m),
        corners_m=errors_m[corners & near],
        label_fit_m=np.hypot(*(told.corners - room.vertices).T)[corners & near],
    )


def cylinders_near_m_of(told: LabelFit, due: np.ndarray) -> list[float]:
    """How near each true cylinder is found: one that is ``due``, bool (n,), as near as the fit ``told`` knows it."""
    sigma_m = np.sqrt(np.max(variances(told.cylinder_covariances), axis=1, initial=0.0))
    return [
        float(np.clip(3 * each, NEAR_M, FAR_M)) if is_due else NEAR_M for each, is_due in zip(sigma_m, due, strict=True)
    ]


def _due(room: Room, surveyed: Sequence[LabelledSweep], told: LabelFit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    heard_from: list[set[Pose]] = [set() for _ in room.vertices]
    for one in surveyed:
        for label in one.labels:
            if label.kind == "wall":
                heard_from[label.index].add(pose_of(one.sweep))
    walls = np.array([len(poses) >= 2 for poses in heard_from])
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
