"""A simulated room with all that its units hear at their true poses, by label, and arrangements of its units: which
echoes one reflector made where some of the units stand elsewhere.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mapper.label_fit import wall_lines
from mapper.room import LabelledSweep, Room

Reflector = tuple[str, int]  # kind, number


@dataclass(frozen=True)
class Echo:
    """Where a reflector is heard: its direction in the unit's frame, and its range."""

    direction_rad: float
    range_m: float


@dataclass(frozen=True)
class Shape:
    """Reflectors of a kind, its share of what is heard; mean and sigma of k and r in a point's range k d - r."""

    share: float
    is_wall: bool
    mean: tuple[float, float] = (1.0, 0.0)
    sigma: tuple[float, float] = (1e-4, 1e-4)


WALL, CORNER = Shape(0.47, True), Shape(0.33, False)
ACUTE, POST = Shape(0.08, False, (0.9, 0.0), (0.08, 1e-4)), Shape(0.12, False, (1.0, 0.22), (1e-4, 0.12))


@dataclass(frozen=True)
class Group:
    """Echoes that one reflector made, (unit's number, what it is by label); ``which`` it is, and whether with the units
    that are moved.
    """

    shape: Shape
    members: tuple[tuple[int, Reflector], ...]
    which: Reflector
    is_moved: bool = False


class Scene:
    """What all units hear at their true poses (n, 3), by label, each its own ``echoes``; the nearest that each hears at
    each whole degree, (n, 360); and the walls' lines (w, 2), alpha and rho.
    """

    def __init__(
        self, room: Room, poses: np.ndarray, echoes: Sequence[dict[Reflector, Echo]], nearest_m: np.ndarray
    ) -> None:
        self.room, self.poses, self.echoes, self.nearest_m = room, poses, echoes, nearest_m
        self.lines = wall_lines(room)
        quarter = room.interior_rad / (np.pi / 2)
        self.is_square = bool(np.allclose(quarter, np.round(quarter), atol=1e-6))
        self.all = sorted(set().union(*echoes))
        self._hearers = {which: tuple(unit for unit, own in enumerate(echoes) if which in own) for which in self.all}

    def shape_of(self, which: Reflector) -> Shape:
        kind, number = which
        if kind == "wall":
            return WALL
        if kind == "cylinder":
            return POST
        return ACUTE if self.room.interior_rad[number] < np.pi / 2 - 1e-6 else CORNER

    def hear(self, which: Reflector) -> tuple[int, ...]:
        return self._hearers[which]


def true_groups(scene: Scene) -> list[Group]:
    return [
        Group(scene.shape_of(which), tuple((unit, which) for unit in scene.hear(which)), which) for which in scene.all
    ]


def point_of(scene: Scene, which: Reflector) -> tuple[float, float, float, float]:
    """Where a point is (x_m, y_m), and k and r of its ranges k d - r."""
    kind, number = which
    if kind == "cylinder":
        x_m, y_m, radius_m = scene.room.cylinders[number]
        return x_m, y_m, 1.0, radius_m
    angle_rad = float(scene.room.interior_rad[number])
    x_m, y_m = scene.room.vertices[number]
    return float(x_m), float(y_m), math.sin(angle_rad) if angle_rad < np.pi / 2 else 1.0, 0.0


def nearest_heard_m(surveyed: Sequence[LabelledSweep], units: int) -> np.ndarray:
    """The nearest that each unit hears within 4 degrees of each whole degree, false echoes left out, (units, 360);
    infinite where it hears nothing, NaN where it does not look.
    """
    nearest_m = np.full((units, 360), np.nan)
    bins_rad = np.radians(np.arange(360))
    for one in surveyed:
        row = nearest_m[int(one.sweep.unit[1:]) - 1]
        for bearing_rad, range_m, label in zip(one.sweep.bearing_rad, one.sweep.range_m, one.labels, strict=True):
            near = np.cos(bins_rad - bearing_rad) > math.cos(math.radians(4))
            row[near] = np.fmin(row[near], range_m if label.index >= 0 else np.inf)
    return nearest_m


def moved(shift: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Poses (..., 3) turned about the origin and then shifted by ``shift`` (..., 3)."""
    cosine, sine = np.cos(shift[..., 2]), np.sin(shift[..., 2])
    x_m, y_m = poses[..., 0], poses[..., 1]
    return np.stack(
        [
            shift[..., 0] + cosine * x_m - sine * y_m,
            shift[..., 1] + sine * x_m + cosine * y_m,
            shift[..., 2] + poses[..., 2],
        ],
        axis=-1,
    )


def wrapped(angle_rad: np.ndarray) -> np.ndarray:
    return (angle_rad + np.pi) % (2 * np.pi) - np.pi
