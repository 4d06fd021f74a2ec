"""A post that comes near a unit, or a door that opens right before it, is no fault of the unit's.

Each draw below was called moved or slipped before the gateway weighed that the room may have changed in one arc, and
that reflectors beside it are heard again.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from gateway.health_rooms import Stand, stand_of, sweep_of
from mapper.fixed_units import CLEARANCE_M
from mapper.room import Room, distance_to_sides_m, inside

from noctule_gateway.health.judge import Judge

POSE = (0.0, 0.0, 0.0)
LIFE = (20, 15, 15)  # sweeps: before, with the change, after it
DOOR_M, NICHE_M = 0.8, 1.0  # how wide, and how deep behind it
OFF_M = 0.3  # at the most, of the door's middle from the point before the unit


def with_post(stand: Stand, rng: np.random.Generator, radius_m: float, nearest_m: float, farthest_m: float) -> Stand:
    """A post whose face is so far from the unit."""
    while True:
        way, distance_m = rng.uniform(0, 2 * math.pi), radius_m + rng.uniform(nearest_m, farthest_m)
        middle = stand.pose[:2] + distance_m * np.array([math.cos(way), math.sin(way)])
        others = [math.hypot(*(middle - (x_m, y_m))) - other_m for x_m, y_m, other_m in stand.room.cylinders]
        clear = inside(middle, stand.room.vertices) and distance_to_sides_m(middle, stand.room.vertices).min() > 0.05
        if clear and all(each_m > radius_m + 0.02 for each_m in others):
            post = (float(middle[0]), float(middle[1]), radius_m)
            return replace(stand, room=replace(stand.room, cylinders=(*stand.room.cylinders, post)))


def before_a_wall(room: Room, rng: np.random.Generator, distance_m: float) -> tuple[Stand, Stand]:
    """A unit somewhere before a wall that is wide enough for a door, and the same with the door open."""
    sides = room.ends - room.vertices
    length_m = np.hypot(*sides.T)
    while True:
        wall = int(rng.choice(np.nonzero(length_m > DOOR_M + 0.5)[0]))
        along = sides[wall] / length_m[wall]
        foot_m = rng.uniform(0.5, length_m[wall] - 0.5)
        door_m = foot_m + rng.uniform(-OFF_M, OFF_M)
        place = room.vertices[wall] + foot_m * along + distance_m * np.array([-along[1], along[0]])
        clear = inside(place, room.vertices) and distance_to_sides_m(place, room.vertices).min() >= CLEARANCE_M
        beside = all(
            math.hypot(*(place - (x_m, y_m))) >= radius_m + CLEARANCE_M for x_m, y_m, radius_m in room.cylinders
        )
        if clear and beside and door_m - DOOR_M / 2 >= 0.05 and door_m + DOOR_M / 2 <= length_m[wall] - 0.05:
            shut = Stand(room, np.array([*place, rng.uniform(-math.pi, math.pi)]))
            return shut, replace(shut, room=with_door_open(room, wall, door_m))


def with_door_open(room: Room, wall: int, middle_m: float) -> Room:
    """A niche in place of a part of the wall, whose middle is so far along it."""
    sides = room.ends - room.vertices
    along = sides[wall] / np.hypot(*sides[wall])
    deep = NICHE_M * np.array([along[1], -along[0]])
    left, right = (room.vertices[wall] + (middle_m + end * DOOR_M / 2) * along for end in (-1, 1))
    return replace(room, vertices=np.insert(room.vertices, wall + 1, [left, left + deep, right + deep, right], axis=0))


def life(kind: str, seed: int) -> tuple[Stand, Stand]:
    """What a unit hears before and during the change."""
    stand, rng = stand_of(seed), np.random.default_rng([seed, 77])
    if kind == "a wide post":
        return stand, with_post(stand, rng, rng.uniform(0.3, 0.5), 0.25, 0.5)
    if kind == "two people":
        return stand, with_post(with_post(stand, rng, 0.25, 0.3, 0.9), rng, 0.2, 0.3, 0.9)
    return before_a_wall(stand.room, rng, 0.3 if kind == "a door at 30 cm" else rng.uniform(0.25, 0.6))


def alarms(kind: str, seed: int) -> set[int]:
    """The kinds of faults that are named, of whatever sweep."""
    before, during = life(kind, seed)
    judge, rng = Judge(), np.random.default_rng([seed, 78])
    stands = [stand for stand, sweeps in zip((before, during, before), LIFE, strict=True) for _ in range(sweeps)]
    sweeps = (sweep_of(stand.hears(rng), number) for number, stand in enumerate(stands))
    return {finding.kind for sweep in sweeps for finding in judge.judge(sweep, POSE).findings}


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("a door at 30 cm", 20000),
        ("a door at 30 cm", 20003),
        ("a door at 30 cm", 20008),
        ("a door at 30 cm", 104100),  # these three hear one to three other reflectors, all where they were
        ("a door at 30 cm", 104102),
        ("a door at 30 cm", 104113),
        ("a door at 30 cm", 63048),  # slips explain what is heard past the door's edge
        ("a door at 30 cm", 63062),
        ("a door", 20004),
        ("a door", 63065),  # one of three other reflectors was not heard in half of the sweeps
        ("a door", 20011),
        ("two people", 20010),
        ("two people", 20024),
        ("two people", 20029),
        ("a wide post", 20000),
        ("a wide post", 20025),
    ],
)
def test_what_comes_near_a_unit_or_opens_before_it_is_no_fault_of_the_unit(kind: str, seed: int) -> None:
    assert alarms(kind, seed) == set()
