"""The rooms that tests map: the paper's and random ones, with their paths; the physics is that of the specular room."""

import math
from dataclasses import replace

import numpy as np

from noctule_mapper.readings.sweep import SweepReadings
from noctule_reproduction.specular import (
    BEARINGS_RAD,
    HALF_BEAM_RAD,
    HARD,
    LONGEST_M,
    PAPER,
    PAPER_BIAS_M,
    PAPER_SIGMA_M,
    PLAIN,
    Label,
    LabelledSweep,
    Physics,
    Room,
    message_of,
    paper_path,
    paper_room,
    survey_labelled,
    walk,
)

__all__ = [
    "BEARINGS_RAD",
    "HALF_BEAM_RAD",
    "HARD",
    "LONGEST_M",
    "PAPER",
    "PAPER_BIAS_M",
    "PAPER_SIGMA_M",
    "PLAIN",
    "Label",
    "LabelledSweep",
    "Physics",
    "Room",
    "l_shaped_room",
    "message_of",
    "paper_path",
    "paper_room",
    "random_convex_room",
    "random_room",
    "survey",
    "survey_labelled",
    "sweep_at",
    "walk",
]

STEP_M = 0.2
CLEARANCE_M = 0.15  # of a cylinder from path, walls and other cylinders


def survey(
    room: Room, poses: np.ndarray, rng: np.random.Generator, sigma_m: float = PAPER_SIGMA_M, calibrated: bool = True
) -> list[SweepReadings]:
    """One sweep of 13 readings at each pose, in order; ranges err by a Gaussian of ``sigma_m`` without a mean."""
    return [one.sweep for one in survey_labelled(room, poses, rng, Physics(sigma_m=sigma_m), calibrated)]


def sweep_at(
    room: Room,
    pose: np.ndarray,
    number: int,
    rng: np.random.Generator,
    sigma_m: float = PAPER_SIGMA_M,
    calibrated: bool = True,
) -> SweepReadings:
    """The sweep ``number`` from ``pose``, 3 s after the one before."""
    (sweep,) = survey(room, pose[None, :], rng, sigma_m, calibrated)
    return replace(sweep, identity=("room", number), time_s=3.0 * number)


def random_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """A room of 2 to 5 m, convex with four to seven walls or an L, at any place and mostly turned, with up to two
    cylinders; and the poses of a path of 0.2 m steps, parallel to its walls, 0.3 to 0.7 m inside them.
    """
    vertices, inner = _l_shape(rng) if rng.random() < 0.4 else _convex(rng)
    turn = rng.uniform(0, 2 * np.pi) if rng.random() < 0.75 else 0.0
    centre = rng.uniform(-2, 2, 2)
    vertices, inner = (_turned(points, turn) + centre for points in (vertices, inner))
    cylinders: list[tuple[float, float, float]] = []
    for _ in range(int(rng.integers(0, 3))):
        radius = float(rng.uniform(0.05, 0.45))
        for x, y in rng.uniform(vertices.min(axis=0), vertices.max(axis=0), (200, 2)):
            if _fits(x, y, radius, vertices, inner, cylinders):
                cylinders.append((float(x), float(y), radius))
                break
    return Room(vertices, tuple(cylinders)), walk(inner, STEP_M)


def random_convex_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """Four to six walls at least 0.7 m from the middle, a path of 0.2 m steps, and perhaps a cylinder within that."""
    while True:
        count = int(rng.integers(4, 7))
        turns = np.sort(rng.uniform(0, 2 * np.pi, count))
        reach = rng.uniform(1.3, 2.1, count)
        vertices = np.stack([reach * np.cos(turns), reach * np.sin(turns)], axis=1)
        sides = np.roll(vertices, -1, axis=0) - vertices
        turning = 180 - np.degrees(Room(vertices).interior_rad)
        inside = (vertices[:, 0] * sides[:, 1] - vertices[:, 1] * sides[:, 0]) / np.hypot(*sides.T)
        if np.all(turning > 20) and np.all(turning < 120) and np.all(np.hypot(*sides.T) > 0.8) and np.all(inside > 0.7):
            break
    room = Room(vertices)
    if rng.random() < 0.5:
        room = replace(
            room,
            cylinders=((float(rng.uniform(-0.1, 0.1)), float(rng.uniform(-0.1, 0.1)), float(rng.uniform(0.05, 0.25))),),
        )
    return room, walk(0.6 * vertices, STEP_M)


def l_shaped_room(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """Two rectangles that make an L, turned at random, with a path 0.45 m inside."""
    width, depth = rng.uniform(2.4, 3.2, 2)
    notch_x, notch_y = rng.uniform(1.1, width - 1.1), rng.uniform(1.1, depth - 1.1)
    turn = rng.uniform(0, 2 * np.pi)
    vertices, inner = (_turned(_l_outline(width, depth, notch_x, notch_y, inset_m), turn) for inset_m in (0.0, 0.45))
    return Room(vertices), walk(inner, STEP_M)


def _l_shape(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """An L of legs at least 1.1 m wide, and the path inside."""
    width, depth = rng.uniform(2.4, 5.0, 2)
    notch_x, notch_y = rng.uniform(1.1, width - 1.1), rng.uniform(1.1, depth - 1.1)
    inset_m = rng.uniform(0.3, min(0.7, (min(notch_x, notch_y) - STEP_M) / 2))
    vertices, inner = (_l_outline(width, depth, notch_x, notch_y, inset) for inset in (0.0, inset_m))
    return vertices - (width / 2, depth / 2), inner - (width / 2, depth / 2)


def _l_outline(width: float, depth: float, notch_x: float, notch_y: float, inset_m: float) -> np.ndarray:
    """The six points, (6, 2), of the L with one corner at the origin, ``inset_m`` inside its walls."""
    m = inset_m
    return np.array(
        [
            (m, m),
            (width - m, m),
            (width - m, notch_y - m),
            (notch_x - m, notch_y - m),
            (notch_x - m, depth - m),
            (m, depth - m),
        ]
    )


def _convex(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A polygon about an ellipse, four to seven walls, 50 to 170 degrees inside its corners, and the path inside."""
    while True:
        theta = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(4, 8))))
        turning = np.degrees(np.diff(theta, append=theta[0] + 2 * np.pi))
        half = rng.uniform(1.0, 2.5, 2)
        rho = np.hypot(half[0] * np.cos(theta), half[1] * np.sin(theta)) * rng.uniform(0.8, 1.1, len(theta))
        inset_m = rng.uniform(0.3, 0.7)
        if not np.all((turning > 10) & (turning < 130)):
            continue
        vertices, inner = _crossings(theta, rho), _crossings(theta, rho - inset_m)
        long_enough = _shortest_side(vertices, theta) > 0.6 and _shortest_side(inner, theta) > STEP_M
        size = np.ptp(vertices, axis=0)
        if long_enough and size.min() > 2 and size.max() < 5:
            return vertices, inner


def _crossings(theta: np.ndarray, rho: np.ndarray) -> np.ndarray:
    """Where each line (theta, rho) starts, (n, 2): at its crossing with the one before it."""
    normals = np.stack([np.cos(theta), np.sin(theta)], axis=1)
    return np.array([np.linalg.solve(normals[[i - 1, i]], rho[[i - 1, i]]) for i in range(len(theta))])


def _shortest_side(vertices: np.ndarray, theta: np.ndarray) -> float:
    """Least length of a side along its wall; negative where a line is no side of the polygon."""
    sides = np.roll(vertices, -1, axis=0) - vertices
    return float((-sides[:, 0] * np.sin(theta) + sides[:, 1] * np.cos(theta)).min())


def _turned(points: np.ndarray, turn_rad: float) -> np.ndarray:
    c, s = math.cos(turn_rad), math.sin(turn_rad)
    return points @ np.array([[c, -s], [s, c]]).T


def _fits(
    x: float,
    y: float,
    radius: float,
    vertices: np.ndarray,
    inner: np.ndarray,
    cylinders: list[tuple[float, float, float]],
) -> bool:
    """Whether a cylinder stands inside the room, clear of walls, path and other cylinders."""
    point, clear = np.array([x, y]), radius + CLEARANCE_M
    apart = all(math.hypot(x - a, y - b) > clear + other for a, b, other in cylinders)
    off_lines = min(distance_to_sides_m(point, corners).min() for corners in (vertices, inner)) > clear
    return apart and off_lines and inside(point, vertices)


def distance_to_sides_m(point: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """How far a point (2,) is from each side of a polygon, (n,)."""
    side = np.roll(vertices, -1, axis=0) - vertices
    share = np.clip(((point - vertices) * side).sum(axis=1) / (side**2).sum(axis=1), 0, 1)
    return np.hypot(*(vertices + share[:, None] * side - point).T)


def inside(point: np.ndarray, vertices: np.ndarray) -> bool:
    start, end = vertices - point, np.roll(vertices, -1, axis=0) - point
    turns = np.arctan2(start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0], (start * end).sum(axis=1))
    return abs(turns.sum()) > np.pi
