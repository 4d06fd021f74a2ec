"""Rooms in which units stand whose poses nobody has stated, but the first one's; and what was found of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from mapper.fixed_units import fixed_room, pose_in, survey_fixed
from mapper.room import Room

from noctule.bounds import UNKNOWN_SIGMA_POSITION_M
from noctule_mapper.contour.contour import Contour, PoseState
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import SweepReadings

# No two of its walls are parallel, none at right angles, and from near its middle a unit hears them all.
IRREGULAR = Room(np.array([(0.0, 0.0), (3.6, -0.5), (4.1, 1.9), (2.0, 3.4), (-0.7, 2.1)]))
NEAR_ITS_MIDDLE = np.array([(1.6, 1.3, 0.4), (2.2, 1.5, 2.1), (1.2, 1.6, -1.2), (2.0, 0.9, -2.8), (1.5, 1.9, 1.0)])
# As wanted of a pose that is found.
MOST_OFF_M, MOST_OFF_RAD = 0.05, math.radians(2)
ELSEWHERE_M, ELSEWHERE_RAD = 0.15, math.radians(6)  # farther off is another place


@dataclass(frozen=True)
class Outcome:
    """Units that were to be found, by name: at their places, at wrong ones, left open, and at their places but not as
    exactly as wanted.
    """

    right: tuple[str, ...]
    wrong: tuple[str, ...]
    left_open: tuple[str, ...]
    inexact: tuple[str, ...] = ()


def rectangle(width_m: float, depth_m: float) -> Room:
    return Room(np.array([(0.0, 0.0), (width_m, 0.0), (width_m, depth_m), (0.0, depth_m)]))


def units_anywhere(room: Room, rng: np.random.Generator, count: int) -> np.ndarray:
    """Poses (count, 3) of units anywhere in the room."""
    return np.array([pose_in(room, rng) for _ in range(count)])


def judged_room(seed: int) -> tuple[Room, np.ndarray]:
    """A room and the poses of four to eight units: of ten rooms seven are random, and one each is a square, a rectangle
    and a corridor whose ends are out of reach.
    """
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 9))
    kind = seed % 10
    if kind < 7:
        return fixed_room(rng, count)
    side_m = float(rng.uniform(2.5, 4.5))
    if kind == 7:
        room = rectangle(side_m, side_m)
    elif kind == 8:
        room = rectangle(side_m, side_m * float(rng.uniform(0.6, 0.95)))
    else:
        room = rectangle(float(rng.uniform(12, 20)), float(rng.uniform(1.5, 2.5)))
    poses = units_anywhere(room, rng, count)
    if kind == 9:
        poses[:, 0] = rng.uniform(4.5, room.vertices[1, 0] - 4.5, count)
    return room, poses


def survey_unknown(room: Room, poses: np.ndarray, rng: np.random.Generator) -> list[SweepReadings]:
    """Each unit's sweeps, the units in turns; all but u1 say that their pose is unknown."""
    swept = [one.sweep for one in survey_fixed(room, poses, rng)]
    return [sweep if sweep.unit == "u1" else erased(sweep) for sweep in swept]


def erased(sweep: SweepReadings) -> SweepReadings:
    return replace(
        sweep,
        x_m=0.0,
        y_m=0.0,
        heading_rad=0.0,
        sigma_position_m=UNKNOWN_SIGMA_POSITION_M,
        sigma_heading_rad=math.pi,
    )


def contour_of(sweeps: Sequence[SweepReadings]) -> Contour:
    mapper = Mapper()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    return mapper.contour()


def outcome(contour: Contour, poses: np.ndarray) -> Outcome:
    """What of the units after the first was found, by their true ``poses``."""
    told = {pose.unit: pose for pose in contour.poses}
    by_name: dict[str, list[str]] = {"right": [], "wrong": [], "open": [], "inexact": []}
    for number, (x_m, y_m, heading_rad) in enumerate(poses[1:], start=2):
        pose = told[f"u{number}"]
        off_m = math.hypot(pose.x_m - x_m, pose.y_m - y_m)
        off_rad = abs(math.remainder(pose.heading_rad - heading_rad, math.tau))
        if pose.state is PoseState.OPEN:
            kind = "open"
        elif off_m < MOST_OFF_M and off_rad < MOST_OFF_RAD:
            kind = "right"
        else:
            kind = "inexact" if off_m < ELSEWHERE_M and off_rad < ELSEWHERE_RAD else "wrong"
        by_name[kind].append(pose.unit)
    return Outcome(*(tuple(names) for names in by_name.values()))
