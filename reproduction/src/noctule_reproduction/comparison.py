"""Contours of many seeds against the paper's room: the figures of Tables I-III with mean and spread, in centimetres."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.choices import Method
from noctule_mapper.contour.contour import Contour, Corner, Cylinder, Wall
from noctule_reproduction import paper
from noctule_reproduction.runs import Run

FAR_CM = 25.0  # what lies farther off a true object is not taken for it
_FAR_SINE = np.sin(np.radians(10.0))


@dataclass(frozen=True)
class Spread:
    """Mean and standard deviation over the ``count`` seeds that have a value; NaN where too few have."""

    mean: float
    deviation: float
    count: int


@dataclass(frozen=True)
class Comparison:
    """One method over all seeds; a wall is (theta in rad, rho), a corner (x, y, error), the cylinder (x, y, radius,
    error of the centre, error of the radius).

    ``corner_error`` is each seed's mean over its corners, then mean and spread of these. ``missed`` and ``surplus``
    count objects over all seeds.
    """

    seeds: int
    walls: tuple[tuple[Spread, ...], ...]
    corners: tuple[tuple[Spread, ...], ...]
    corner_error: Spread
    cylinder: tuple[Spread, ...]
    missed: int
    surplus: int
    notes: tuple[str, ...]  # why a contour has nothing, or no more


def compare(runs: Sequence[Run], method: Method) -> Comparison:
    """How ``method`` did over ``runs``, at least one."""
    walls = np.array([wall_values(run.contours[method]) for run in runs])
    corners = np.array([corner_values(run.contours[method]) for run in runs])
    cylinders = np.array([cylinder_values(run.contours[method]) for run in runs])
    found = sum(int(np.isfinite(values[..., 0]).sum()) for values in (walls, corners, cylinders))
    there = sum(values[..., 0].size for values in (walls, corners, cylinders))
    reported = sum(
        len(contour.walls) + len(contour.corners) + len(contour.cylinders)
        for contour in (run.contours[method] for run in runs)
    )
    return Comparison(
        seeds=len(runs),
        walls=tuple(_spreads(walls[:, k]) for k in range(walls.shape[1])),
        corners=tuple(_spreads(corners[:, k]) for k in range(corners.shape[1])),
        corner_error=spread([_mean(errors) for errors in corners[:, :, 2]]),
        cylinder=_spreads(cylinders),
        missed=there - found,
        surplus=reported - found,
        notes=tuple(dict.fromkeys(note for run in runs if (note := run.contours[method].note))),
    )


def wall_values(contour: Contour) -> np.ndarray:
    """(theta_rad, rho_cm) of the walls 1-5, (5, 2), theta near that of Table I; NaN where a wall is missing."""
    corners = np.array(paper.CORNERS["true"])
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    values = np.full((len(middles), 2), np.nan)
    taken: set[int] = set()
    for number, (middle, (theta, _)) in enumerate(zip(middles, paper.LINES["true"], strict=True)):
        nearest = _take_nearest([_wall_off_cm(wall, middle, theta) for wall in contour.walls], taken)
        if nearest is not None:
            wall = contour.walls[nearest]
            turns = round((wall.theta_rad - theta) / np.pi)
            values[number] = wall.theta_rad - turns * np.pi, (-1) ** turns * 100 * wall.rho_m
    return values


def corner_values(contour: Contour) -> np.ndarray:
    """(x, y, error) in cm of the corners A-E, (5, 3); NaN where a corner is missing."""
    values = np.full((len(paper.CORNER_NAMES), 3), np.nan)
    taken: set[int] = set()
    for number, true in enumerate(paper.CORNERS["true"]):
        off_cm = [_off_cm(corner, true) for corner in contour.corners]
        nearest = _take_nearest(off_cm, taken)
        if nearest is not None:
            corner = contour.corners[nearest]
            values[number] = 100 * corner.x_m, 100 * corner.y_m, off_cm[nearest]
    return values


def cylinder_values(contour: Contour) -> np.ndarray:
    """(x, y, radius, error of the centre, error of the radius) in cm of the cylinder F, (5,); NaN if it is missing."""
    x, y, radius = paper.CYLINDER["true"]
    off_cm = [_off_cm(cylinder, (x, y)) for cylinder in contour.cylinders]
    nearest = _take_nearest(off_cm, set())
    if nearest is None:
        return np.full(5, np.nan)
    found = contour.cylinders[nearest]
    radius_cm = 100 * found.radius_m
    return np.array([100 * found.x_m, 100 * found.y_m, radius_cm, off_cm[nearest], abs(radius_cm - radius)])


def spread(values: Sequence[float] | np.ndarray) -> Spread:
    """Mean and standard deviation of those values that are not NaN."""
    there = np.asarray(values, dtype=float)
    there = there[np.isfinite(there)]
    mean = float(there.mean()) if len(there) else float("nan")
    return Spread(mean, float(there.std(ddof=1)) if len(there) > 1 else float("nan"), len(there))


def _spreads(values: np.ndarray) -> tuple[Spread, ...]:
    """Of each column of (seeds, columns)."""
    return tuple(spread(column) for column in values.T)


def _take_nearest(off_cm: Sequence[float], taken: set[int]) -> int | None:
    """The number of the object that is least off, if it is near and not taken yet; it is taken then."""
    free = [number for number in range(len(off_cm)) if number not in taken]
    best = min(free, key=lambda number: off_cm[number], default=None)
    if best is None or off_cm[best] > FAR_CM:
        return None
    taken.add(best)
    return best


def _off_cm(one: Corner | Cylinder, true: tuple[float, float]) -> float:
    return float(np.hypot(100 * one.x_m - true[0], 100 * one.y_m - true[1]))


def _wall_off_cm(wall: Wall, middle_cm: np.ndarray, theta_rad: float) -> float:
    """Distance of a true wall's middle from a found wall's line; infinite where they point elsewhere."""
    if abs(np.sin(wall.theta_rad - theta_rad)) > _FAR_SINE:
        return np.inf
    return float(abs(wall.normal @ middle_cm - 100 * wall.rho_m))


def _mean(errors: np.ndarray) -> float:
    there = errors[np.isfinite(errors)]
    return float(there.mean()) if len(there) else float("nan")
