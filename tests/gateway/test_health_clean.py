"""Ten thousand sweeps of sound units raise no alarm but that there is no echo anywhere, where that is true."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from gateway.health_rooms import CLEAR, COARSE_RAD, Noise, Stand, noisy, stand_of, sweep_of
from mapper.fixed_units import BEARINGS_RAD, PERSON_RADIUS_M, fixed_room
from mapper.room import Room, distance_to_sides_m, inside, random_room, survey_labelled

from noctule import messages_pb2 as messages
from noctule_gateway.health.judge import Finding, Judge
from noctule_gateway.health.readings import Readings

POSE = (0.0, 0.0, 0.0)
ROOMS, SWEEPS = 10, 200  # of each kind of life in it


def alarms(sweeps: Iterator[Readings]) -> list[Finding]:
    judge = Judge()
    return [finding for each in sweeps for finding in judge.judge(each, POSE).findings]


def quiet(stand: Stand, rng: np.random.Generator) -> Iterator[Readings]:
    for number in range(SWEEPS):
        yield sweep_of(stand.hears(rng), number)


def with_people(stand: Stand, rng: np.random.Generator) -> Iterator[Readings]:
    """Someone is in the room in one sweep of three, each time elsewhere, and now and then stands for four sweeps."""
    crowded = [replace(stand, room=with_person(stand, rng), draws=1) for _ in range(30)]
    here, left = stand, 0
    for number in range(SWEEPS):
        if left:
            left -= 1
        else:
            here = crowded[rng.integers(len(crowded))] if rng.random() < 0.33 else stand
            left = 3 if rng.random() < 0.1 else 0
        yield sweep_of(here.hears(rng), number)


def with_door(stand: Stand, rng: np.random.Generator) -> Iterator[Readings]:
    """A door in the longest wall opens into a niche 1 m deep, and closes again, every twenty sweeps."""
    ajar = replace(stand, room=with_niche(stand.room))
    for number in range(SWEEPS):
        yield sweep_of((ajar if number // 20 % 2 else stand).hears(rng), number)


def with_furniture(stand: Stand, rng: np.random.Generator) -> Iterator[Readings]:
    """A post of 30 cm comes, comes to stand elsewhere and goes, every fifty sweeps; the air warms and cools."""
    furnished = [replace(stand, room=with_person(stand, rng, 0.3)) for _ in range(2)]
    here = [stand, *furnished, stand]
    for number in range(SWEEPS):
        range_m = here[number // 50 % 4].hears(rng)
        yield sweep_of(range_m * (1 + 0.003 * math.sin(2 * math.pi * number / 120)), number)  # 3.4 K, not measured


def with_person(stand: Stand, rng: np.random.Generator, radius_m: float = PERSON_RADIUS_M) -> Room:
    """The room with someone in it, who keeps 30 cm from the unit."""
    low, high = stand.room.vertices.min(axis=0), stand.room.vertices.max(axis=0)
    while True:
        x_m, y_m = rng.uniform(low, high)
        clear = math.hypot(x_m - stand.pose[0], y_m - stand.pose[1]) > radius_m + 0.3
        clear = clear and inside(np.array([x_m, y_m]), stand.room.vertices)
        if clear and distance_to_sides_m(np.array([x_m, y_m]), stand.room.vertices).min() > 0.05:
            return replace(stand.room, cylinders=(*stand.room.cylinders, (float(x_m), float(y_m), radius_m)))


def with_niche(room: Room) -> Room:
    sides = room.ends - room.vertices
    wall = int(np.hypot(*sides.T).argmax())
    start, along = room.vertices[wall], sides[wall] / np.hypot(*sides[wall])
    outward = np.array([along[1], -along[0]])
    middle = start + sides[wall] / 2
    left, right = middle - 0.4 * along, middle + 0.4 * along
    niche = np.array([left, left + outward, right + outward, right])
    return replace(room, vertices=np.insert(room.vertices, wall + 1, niche, axis=0))


@pytest.mark.parametrize("life", [quiet, with_people, with_door, with_furniture], ids=lambda life: life.__name__)
def test_a_sound_unit_raises_no_alarm(life) -> None:
    for seed in range(ROOMS):
        stand, rng = stand_of(100 + seed), np.random.default_rng(seed)
        assert alarms(life(stand, rng)) == [], seed


def test_a_carried_unit_raises_no_alarm() -> None:
    """On coarse sweeps around random rooms; a fine one from where it stands."""
    made = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        room, path = random_room(rng)
        judge = Judge()
        surveyed = survey_labelled(room, path, rng, CLEAR, True, COARSE_RAD if seed % 2 else BEARINGS_RAD)
        for number, one in enumerate(surveyed):
            range_m = noisy(one.sweep.range_m, rng, Noise())
            pose = tuple(map(float, path[number]))
            found = judge.judge(sweep_of(range_m, number, one.sweep.bearing_rad, fixed=False), pose).findings
            silent = all(each.kind == messages.FAULT_KIND_NO_ECHO_ANYWHERE for each in found)
            assert silent and (not found or np.isnan(range_m).all()), (seed, number, found)
            made += 1
    assert made >= 1000


def test_an_empty_hall_is_silent_and_that_alone_is_said() -> None:
    room, poses = fixed_room(np.random.default_rng(3), 1)
    hall = Stand(Room(20 * room.vertices), 20 * poses[0] * (1, 1, 1 / 20))
    assert np.isnan(hall.clear_m).all()
    rng, judge = np.random.default_rng(1), Judge()
    found = [judge.judge(sweep_of(hall.hears(rng, Noise(false=0.0)), number), POSE) for number in range(1000)]
    assert all(not each.findings for each in found[:2])
    assert all([one.kind for one in each.findings] == [messages.FAULT_KIND_NO_ECHO_ANYWHERE] for each in found[2:])
    assert not any(each.spoiled_by for each in found)


def test_a_hall_with_false_echoes_raises_no_other_alarm() -> None:
    """One sweep of thirteen has none, three in a row now and then."""
    rng = np.random.default_rng(2)
    found = alarms(sweep_of(noisy(np.full(61, math.nan), rng, Noise()), number) for number in range(1000))
    assert {one.kind for one in found} <= {messages.FAULT_KIND_NO_ECHO_ANYWHERE}


@pytest.mark.parametrize("fixed", [True, False])
def test_walls_beyond_four_metres_and_a_half_are_no_alarm(fixed: bool) -> None:
    """The unit takes echoes of up to 36 ms, 6.2 m (firmware/README.md)."""
    rng, walls_m = np.random.default_rng(4), np.where(np.arange(61) // 5 % 2, 5.0, math.nan)
    found = alarms(sweep_of(noisy(walls_m, rng, Noise()), number, fixed=fixed) for number in range(200))
    assert {one.kind for one in found} <= {messages.FAULT_KIND_NO_ECHO_ANYWHERE}
