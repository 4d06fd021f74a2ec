"""Rooms through which a person carries one unit, with a stop every metre or so; and what the map of them must have.

A wall is due when it is heard from two stops and a fit that knows every label, the stops' errors among them, determines
its direction to 1.5 degrees; a corner of two due walls when it is known to 4 cm.
"""

import math
from dataclasses import replace

import numpy as np
from mapper.fixed_units import BEARINGS_RAD as FINE_RAD
from mapper.fixed_units import CLEARANCE_M, FIXED
from mapper.room import BEARINGS_RAD as COARSE_RAD
from mapper.room import LabelledSweep, Room, distance_to_sides_m, inside, random_room, survey_labelled

LEAST_STEP_M, MOST_STEP_M = 0.8, 1.2  # from one stop to the next
# What somebody errs by who sets a unit down on marks on the floor; stated so.
BY_HAND = replace(FIXED, sigma_position_m=0.01, sigma_heading_rad=math.radians(1))

__all__ = ["BY_HAND", "COARSE_RAD", "FINE_RAD", "room_with_stops", "survey_by_hand"]


def room_with_stops(rng: np.random.Generator) -> tuple[Room, np.ndarray]:
    """A random room and the stops' poses, (stops, 3): on a round 0.3 to 0.7 m inside the walls or, in every third room,
    on a straight way through its middle; heading as the person walks.
    """
    room, path = random_room(rng)
    way = path[:, :2]
    if rng.random() < 1 / 3:
        return room, _stops(_longest_way(room, way), rng)
    return room, _stops(np.concatenate([way, way[:1]]), rng)


def survey_by_hand(
    room: Room, stops: np.ndarray, rng: np.random.Generator, bearings_rad: np.ndarray, sweeps: int
) -> list[LabelledSweep]:
    """So many sweeps at each stop, (stops, 3), before the person walks on."""
    surveyed = survey_labelled(room, np.repeat(stops, sweeps, axis=0), rng, BY_HAND, True, bearings_rad)
    return [replace(one, sweep=replace(one.sweep, identity=("log1", number))) for number, one in enumerate(surveyed)]


def _stops(way: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Poses along a way of straight pieces, (n, 2); none so near its end that a step is left before it."""
    lengths = np.hypot(*np.diff(way, axis=0).T)
    along_m = np.concatenate([[0.0], np.cumsum(lengths)])
    at_m = np.cumsum(rng.uniform(LEAST_STEP_M, MOST_STEP_M, int(along_m[-1] / LEAST_STEP_M) + 1)) - LEAST_STEP_M / 2
    at_m = at_m[at_m < along_m[-1]]
    piece = np.minimum(np.searchsorted(along_m, at_m, side="right") - 1, len(lengths) - 1)
    ahead = np.diff(way, axis=0)[piece]
    point = way[piece] + ahead * ((at_m - along_m[piece]) / lengths[piece])[:, None]
    return np.column_stack([point, np.arctan2(ahead[:, 1], ahead[:, 0])])


def _longest_way(room: Room, points: np.ndarray) -> np.ndarray:
    """The longest straight way between two of the ``points`` that is clear of walls and cylinders, (2, 2)."""
    i, j = np.triu_indices(len(points), 1)
    for number in np.argsort(-np.hypot(*(points[i] - points[j]).T)):
        start, end = points[i[number]], points[j[number]]
        if all(_is_clear(start + share * (end - start), room) for share in np.linspace(0, 1, 50)):
            return np.array([start, end])
    raise ValueError("no two points of the path see each other")


def _is_clear(point: np.ndarray, room: Room) -> bool:
    clear = inside(point, room.vertices) and distance_to_sides_m(point, room.vertices).min() > CLEARANCE_M
    return bool(clear and all(math.hypot(point[0] - x, point[1] - y) > r + CLEARANCE_M for x, y, r in room.cylinders))
