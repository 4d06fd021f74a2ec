"""Outlines: walls that meet, end to start, as rings and open chains of points, to draw and to export."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule.errors import NoctuleError

Point = tuple[float, float]


class OutlineError(NoctuleError):
    """Corners that can't be of these walls; the message names the corner, what is wrong and what to do."""


@dataclass(frozen=True)
class Outline:
    """Walls in the order of a walk with the room on the left, by their indices, and the points (k, 2) between them.

    A closed one has as many points as walls, all of them corners; an open one has one more, its first and last points
    the ends of walls that meet no other.
    """

    points: np.ndarray
    closed: bool
    walls: tuple[int, ...]


def outlines(
    walls: Sequence[tuple[Point, Point]], corners: Sequence[tuple[float, float, tuple[int, int]]]
) -> list[Outline]:
    """Outlines of ``walls`` (start, end) joined at ``corners`` (x_m, y_m, (wall that ends, wall that starts)).

    Every wall is in one outline; they come in the order of their lowest wall. Raises OutlineError where a corner names
    a wall that is not there, or an end or a start that another corner has.
    """
    after, before = _joints(len(walls), corners)
    left = set(range(len(walls)))
    found = []
    while left:
        lowest = min(left)
        first, closed = _first_of_chain(lowest, before)
        chain = [first]
        while (corner := after.get(chain[-1])) is not None and corners[corner][2][1] != first:
            chain.append(corners[corner][2][1])
        left -= set(chain)
        points = [] if closed else [walls[first][0]]
        points += [corners[after[wall]][:2] if wall in after else walls[wall][1] for wall in chain]
        if closed:  # the corner at which the first wall starts comes first
            points = points[-1:] + points[:-1]
        found.append(Outline(np.array(points, dtype=float), closed, tuple(chain)))
    return found


def _joints(
    walls: int, corners: Sequence[tuple[float, float, tuple[int, int]]]
) -> tuple[dict[int, int], dict[int, int]]:
    """The corner at which each wall ends, and the wall before each wall."""
    after: dict[int, int] = {}
    before: dict[int, int] = {}
    for number, (x_m, y_m, (first, second)) in enumerate(corners):
        name = f"corner {number} at ({x_m:.3f}, {y_m:.3f}) joins walls {first} and {second}"
        if not (0 <= first < walls and 0 <= second < walls):
            raise OutlineError(f"{name}, but there are {walls} walls: take walls and corners from one contour")
        if first in after or second in before:
            raise OutlineError(f"{name}, one of which another corner has joined there: give a wall's end one corner")
        after[first], before[second] = number, first
    return after, before


def _first_of_chain(wall: int, before: dict[int, int]) -> tuple[int, bool]:
    """The wall that the chain of ``wall`` starts with, and whether it is a ring, which then starts with ``wall``."""
    first = wall
    while first in before:
        first = before[first]
        if first == wall:
            return wall, True
    return first, False
