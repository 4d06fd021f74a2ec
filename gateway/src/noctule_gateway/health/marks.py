"""The marks that a fixed unit knows its place by: runs of neighbouring bearings that hear one reflector.

From a unit that has moved by d, a reflector in the direction u is nearer by d . u, wall, corner and post alike, as long
as d is small against its range. A wardrobe or a door changes one mark or two; the unit's own motion changes all.
"""

import math
from dataclasses import dataclass
from itertools import combinations
from statistics import median

from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past

_ONE_REFLECTOR_M = 0.03
_FITS_M = 0.012  # four times the noise of a mark's median, and half a cycle of 40 kHz
_LEAST_ANGLE_RAD = math.radians(25.0)  # between two marks that determine a motion
_MOST_MOVED_M = 0.5


@dataclass(frozen=True)
class Mark:
    """A mark in one sweep: its direction, its range in the past, and how much longer it is now."""

    direction_rad: float
    range_m: float
    longer_m: float


@dataclass(frozen=True)
class Motion:
    """Moved by (x_m, y_m) in the unit's own frame, x forward. Of ``marks``, ``fitting`` fit that, ``still`` none."""

    x_m: float
    y_m: float
    marks: int
    fitting: int
    still: int

    @property
    def distance_m(self) -> float:
        return math.hypot(self.x_m, self.y_m)


def marks_of(look: Look, past: Past, offset: int = 0) -> list[Mark]:
    """The past's marks that the sweep hears; it looks ``offset`` steps further than it says."""
    found = []
    for run in runs_of(past):
        here = [number - offset for number in run if 0 <= number - offset < len(look.range_m)]
        longer = [look.range_m[n] - past.median_m[n + offset] for n in here if not math.isnan(look.range_m[n])]
        if len(longer) * 2 <= len(here):
            continue
        direction_rad = sum(look.bearing_rad[n] for n in here) / len(here)
        found.append(Mark(direction_rad, median(past.median_m[n] for n in run), median(longer)))
    return found


def motion_of(marks: list[Mark]) -> Motion | None:
    """The motion that the most marks fit; None with fewer than three marks."""
    if len(marks) < 3:
        return None
    best, fitting = (0.0, 0.0), _fitting(marks, 0.0, 0.0)
    for one, other in combinations(marks, 2):
        solved = _solved(one, other)
        if solved is None or math.hypot(*solved) > _MOST_MOVED_M:
            continue
        count = _fitting(marks, *solved)
        if count > fitting:
            best, fitting = solved, count
    return Motion(*best, len(marks), fitting, _fitting(marks, 0.0, 0.0))


def runs_of(past: Past) -> list[list[int]]:
    """Runs of stable bearings at one range; a bearing alone is no mark where there is a finer plan's neighbour."""
    runs: list[list[int]] = []
    for number in past.stable():
        last = runs[-1][-1] if runs else -2
        joined = number == last + 1 and abs(past.median_m[number] - past.median_m[last]) <= _ONE_REFLECTOR_M
        if joined:
            runs[-1].append(number)
        else:
            runs.append([number])
    return [run for run in runs if len(run) >= 2]


def _solved(one: Mark, other: Mark) -> tuple[float, float] | None:
    """The motion that both marks tell, by Cramer's rule."""
    a, b = math.cos(one.direction_rad), math.sin(one.direction_rad)
    c, d = math.cos(other.direction_rad), math.sin(other.direction_rad)
    determinant = a * d - b * c
    if abs(determinant) < math.sin(_LEAST_ANGLE_RAD):
        return None
    return (-one.longer_m * d + other.longer_m * b) / determinant, (
        -other.longer_m * a + one.longer_m * c
    ) / determinant


def _fitting(marks: list[Mark], x_m: float, y_m: float) -> int:
    return sum(
        abs(one.longer_m + x_m * math.cos(one.direction_rad) + y_m * math.sin(one.direction_rad)) <= _FITS_M
        for one in marks
    )
