"""A specular room for tests: what an HC-SR04 would hear in a polygon with cylinders in it.

A smooth wall answers from the foot of its perpendicular alone, a concave corner by double bounce, a reflex edge only
close by, a cylinder from its nearest point; the sensor reports the nearest of what lies inside its beam and in plain
sight. It shares nothing with the mapper but the type of a sweep, and nothing with the firmware's simulator.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.sweep import SweepReadings

HALF_BEAM_RAD = math.radians(11.25)
BEARINGS_RAD = np.radians(np.arange(-135, 136, 22.5))  # Liu et al. 2019, Section VI
PAPER_SIGMA_M = 0.0032  # Section V.A
LONGEST_M = 4.0
EDGE_REACH_M = 0.5
CYLINDER_REACH_M = 2.5


@dataclass(frozen=True)
class Room:
    """A closed polygon, its vertices (n, 2) anticlockwise, and cylinders (x, y, radius)."""

    vertices: np.ndarray
    cylinders: tuple[tuple[float, float, float], ...] = ()

    @property
    def ends(self) -> np.ndarray:
        """The walls' second points, (n, 2)."""
        return np.roll(self.vertices, -1, axis=0)


def paper_room() -> Room:
    """Tables II and III of the paper: corners E, D, C, B, A and the cylinder F."""
    corners = [(-1.145, -0.516), (0.717, -0.931), (2.200, -0.702), (2.585, 1.028), (-0.621, 1.833)]
    return Room(np.array(corners), ((1.384, 0.480, 0.448),))


def paper_path() -> np.ndarray:
    """The 44 poses (x, y, heading) of the rectangle (-0.70, -0.45) to (2.00, 1.05) walked in steps of 0.2 m, the last
    of a side shorter.
    """
    return walk(np.array([(-0.70, -0.45), (2.00, -0.45), (2.00, 1.05), (-0.70, 1.05)]), 0.2)


def walk(corners: np.ndarray, spacing_m: float) -> np.ndarray:
    """Poses (n, 3) along a closed path, heading along each side; a corner belongs to the side that begins there."""
    poses = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = end - start
        length = math.hypot(*along)
        heading = math.atan2(along[1], along[0])
        poses += [(*(start + along * (s / length)), heading) for s in np.arange(0, length - 1e-9, spacing_m)]
    return np.array(poses)


def random_convex_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """Four to six walls at least 0.7 m from the middle, a path of 0.2 m steps, and perhaps a cylinder within that."""
    while True:
        count = int(rng.integers(4, 7))
        turns = np.sort(rng.uniform(0, 2 * np.pi, count))
        reach = rng.uniform(1.3, 2.1, count)
        vertices = np.stack([reach * np.cos(turns), reach * np.sin(turns)], axis=1)
        sides = np.roll(vertices, -1, axis=0) - vertices
        turning = np.degrees(_turning(np.roll(sides, 1, axis=0), sides))
        inside = (vertices[:, 0] * sides[:, 1] - vertices[:, 1] * sides[:, 0]) / np.hypot(*sides.T)
        if np.all(turning > 20) and np.all(turning < 120) and np.all(np.hypot(*sides.T) > 0.8) and np.all(inside > 0.7):
            break
    room = Room(vertices)
    if rng.random() < 0.5:
        room = replace(
            room,
            cylinders=((float(rng.uniform(-0.1, 0.1)), float(rng.uniform(-0.1, 0.1)), float(rng.uniform(0.05, 0.25))),),
        )
    return room, walk(0.6 * vertices, 0.2)


def l_shaped_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """Two rectangles that make an L, turned at random, with a path 0.45 m inside."""
    width, depth = rng.uniform(2.4, 3.2, 2)
    notch_x, notch_y = rng.uniform(1.1, width - 1.1), rng.uniform(1.1, depth - 1.1)
    vertices = np.array([(0, 0), (width, 0), (width, notch_y), (notch_x, notch_y), (notch_x, depth), (0, depth)])
    m = 0.45
    inner = np.array(
        [
            (m, m),
            (width - m, m),
            (width - m, notch_y - m),
            (notch_x - m, notch_y - m),
            (notch_x - m, depth - m),
            (m, depth - m),
        ]
    )
    turn = rng.uniform(0, 2 * np.pi)
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return Room(vertices @ rotation.T), walk(inner @ rotation.T, 0.2)


def survey(
    room: Room, poses: np.ndarray, rng: np.random.Generator, sigma_m: float = PAPER_SIGMA_M, calibrated: bool = True
) -> list[SweepReadings]:
    """One sweep of 13 readings at each pose, in order; ranges err by a Gaussian of ``sigma_m`` without a mean."""
    return [sweep_at(room, pose, number, rng, sigma_m, calibrated) for number, pose in enumerate(poses)]


def sweep_at(
    room: Room,
    pose: np.ndarray,
    number: int,
    rng: np.random.Generator,
    sigma_m: float = PAPER_SIGMA_M,
    calibrated: bool = True,
) -> SweepReadings:
    """The sweep ``number`` from ``pose``, 3 s after the one before."""
    true_m = np.array([nearest(room, pose[:2], pose[2] + bearing, rng) for bearing in BEARINGS_RAD])
    return SweepReadings(
        identity=("room", number),
        unit="u1",
        time_s=3.0 * number,
        x_m=float(pose[0]),
        y_m=float(pose[1]),
        heading_rad=float(pose[2]),
        sigma_position_m=0.0,
        sigma_heading_rad=0.0,
        bearing_rad=BEARINGS_RAD,
        range_m=true_m + rng.normal(0, sigma_m, len(true_m)),
        no_echo=np.isnan(true_m),
        beam_width_rad=2 * HALF_BEAM_RAD,
        range_sigma_m=sigma_m if calibrated else None,
    )


def nearest(room: Room, place: np.ndarray, axis_rad: float, rng: np.random.Generator) -> float:
    """Range to the nearest reflector in the beam, NaN where none answers."""
    answers = [
        (range_m, touch)
        for range_m, touch in (*_feet(room, place), *_corners(room, place, rng), *_cylinders(room, place))
        if abs(_wrap(math.atan2(*(touch - place)[::-1]) - axis_rad)) <= HALF_BEAM_RAD and 0.02 < range_m < LONGEST_M
    ]
    for range_m, touch in sorted(answers, key=lambda answer: answer[0]):
        if _in_sight(room, place, touch):
            return range_m
    return math.nan


def _feet(room: Room, place: np.ndarray):
    for start, end in zip(room.vertices, room.ends, strict=True):
        along = (end - start) / math.hypot(*(end - start))
        s = float(np.dot(place - start, along))
        if 0 <= s <= math.hypot(*(end - start)):
            foot = start + s * along
            yield math.hypot(*(foot - place)), foot


def _corners(room: Room, place: np.ndarray, rng: np.random.Generator):
    before = room.vertices - np.roll(room.vertices, 1, axis=0)
    interior = np.pi - _turning(before, room.ends - room.vertices)
    for vertex, angle in zip(room.vertices, interior, strict=True):
        distance = math.hypot(*(vertex - place))
        if angle > np.pi:
            if distance < EDGE_REACH_M:
                yield distance, vertex
        elif angle < np.pi / 2:
            yield distance * math.sin(angle), vertex
        elif rng.random() < 1 - (math.degrees(angle) - 90) / 40:
            yield distance, vertex


def _cylinders(room: Room, place: np.ndarray):
    for x, y, radius in room.cylinders:
        towards = np.array([x, y]) - place
        distance = math.hypot(*towards)
        if radius < distance < CYLINDER_REACH_M:
            yield distance - radius, place + towards * (1 - radius / distance)


def _in_sight(room: Room, place: np.ndarray, touch: np.ndarray) -> bool:
    """Whether nothing stands between; the last millimetre, at the reflector itself, doesn't count."""
    way = touch - place
    way = way * (1 - 1e-3 / math.hypot(*way))
    for start, end in zip(room.vertices, room.ends, strict=True):
        side = end - start
        denominator = way[0] * side[1] - way[1] * side[0]
        if abs(denominator) > 1e-12:
            offset = start - place
            s = (offset[0] * side[1] - offset[1] * side[0]) / denominator
            t = (offset[0] * way[1] - offset[1] * way[0]) / denominator
            if 0 < s < 1 and 0 <= t <= 1:
                return False
    for x, y, radius in room.cylinders:
        offset = np.array([x, y]) - place
        s = float(np.clip(np.dot(offset, way) / np.dot(way, way), 0, 1))
        if math.hypot(*(offset - s * way)) < radius:
            return False
    return True


def _turning(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angles from vectors a to b, (n,), anticlockwise positive."""
    return np.arctan2(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0], (a * b).sum(axis=1))


def _wrap(angle_rad: float) -> float:
    return math.atan2(math.sin(angle_rad), math.cos(angle_rad))
