"""Units that stand still: what they must find of rooms that nobody has carried anything through."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.fixed_units import Verdict, fixed_room, judge_fixed, survey_fixed
from mapper.room import Room
from system.processes import two_processes

from noctule import bounds
from noctule_mapper.contour.contour import Contour
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message

# No room from these seeds on was ever looked at while the mapper was made.
FIRST_SEED, ROOMS = 93_000, 100
# What users are promised: of the walls that are due 3 % may be missed, of corners and cylinders 5 %.
MOST_MISSED = {"wall": 0.03, "corner": 0.05, "cylinder": 0.05}
MOST_FALSE = 4


def contour_of(room: Room, poses: np.ndarray, rng: np.random.Generator) -> tuple[Contour, Verdict]:
    surveyed = survey_fixed(room, poses, rng)
    mapper = Mapper()
    for one in surveyed:
        mapper.register_sweep(one.sweep)
    contour = mapper.contour()
    return contour, judge_fixed(contour, room, surveyed)


RECTANGLE = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
ON_THE_WALLS = np.array([(0.3, 0.6, 0.5), (3.7, 0.8, 2.6), (3.5, 2.6, -2.2), (0.6, 2.7, -0.9)])


def test_four_units_on_the_walls_of_a_plain_room_find_all_of_it() -> None:
    contour, verdict = contour_of(RECTANGLE, ON_THE_WALLS, np.random.default_rng(1))
    assert (len(contour.walls), len(contour.corners), len(contour.cylinders)) == (4, 4, 0)
    assert not verdict.missed
    assert not verdict.false
    # A range errs by 3.2 mm, and each wall is heard some 40 times.
    assert verdict.corners_m.max() < 0.01


def test_two_units_metres_apart_make_the_walls_that_both_hear() -> None:
    contour, verdict = contour_of(RECTANGLE, ON_THE_WALLS[[0, 2]], np.random.default_rng(2))
    assert "wall 0" in verdict.due
    assert not verdict.missed
    assert not verdict.false
    assert contour.walls


def test_two_units_that_face_each_other_hear_the_radius_of_the_post_between_them() -> None:
    """Their ranges leave between them as much as the post is thick; no wall and no edge answers to two sides."""
    room = Room(RECTANGLE.vertices, ((2.0, 1.4, 0.1),))
    contour, verdict = contour_of(room, np.array([(1.3, 1.45, -0.3), (2.8, 1.4, 2.8)]), np.random.default_rng(3))
    assert not verdict.false
    (post,) = contour.cylinders
    # sqrt(2) / 2 of a range's error of 3.2 mm, which plateaus halve at best (readings/plateaus.py), five times over.
    assert post.radius_m == pytest.approx(0.1, abs=0.006)


@pytest.mark.parametrize("seed", [7004, 7031, 7050])
def test_what_greedy_growth_alone_missed_is_found(seed: int) -> None:
    # In the first two a cylinder hides a wall from units that look towards it; the third grows well from its walls.
    rng = np.random.default_rng(seed)
    _, verdict = contour_of(*fixed_room(rng), rng)
    assert verdict.due
    assert not verdict.missed
    assert not verdict.false


@pytest.mark.parametrize("seed", range(3))
def test_one_unit_alone_makes_no_false_object(seed: int) -> None:
    rng = np.random.default_rng(seed)
    contour, verdict = contour_of(RECTANGLE, ON_THE_WALLS[[seed]], rng)
    assert not verdict.false
    assert contour.sweeps == 4


@pytest.mark.filterwarnings("error")
@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), units=st.integers(1, 4), share=st.sampled_from([0.05, 0.5, 1.0]))
def test_whatever_fine_sweeps_hear_makes_a_map(seed: int, units: int, share: float) -> None:
    """Ranges from anywhere, some of them the same at many bearings, in place of a room's."""
    rng = np.random.default_rng(seed)
    mapper = Mapper()
    for number, one in enumerate(survey_fixed(RECTANGLE, ON_THE_WALLS[:units], rng)):
        range_m = np.where(rng.random(61) < 0.5, rng.choice(rng.uniform(0.02, 4.0, 3), 61), rng.uniform(0.02, 4.0, 61))
        range_m[rng.random(61) >= share] = np.nan
        sweep = replace(one.sweep, range_m=range_m, no_echo=np.isnan(range_m), identity=("log", number))
        mapper.register_sweep(sweep)
    bounds.check(contour_message(mapper.contour(), "s"))


@cache
def verdicts() -> list[Verdict]:
    with two_processes() as pool:
        return list(pool.map(_verdict, range(FIRST_SEED, FIRST_SEED + ROOMS)))


def _verdict(seed: int) -> Verdict:
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng)
    return contour_of(room, poses, rng)[1]


@pytest.mark.soak
@pytest.mark.parametrize("kind", MOST_MISSED)
def test_nearly_all_that_the_echoes_show_is_found(kind: str) -> None:
    due, missed = (sum(what.startswith(kind) for one in verdicts() for what in of(one)) for of in (_due, _missed))
    assert due > ROOMS // 4
    assert missed <= MOST_MISSED[kind] * due, f"{missed} of {due}"


@pytest.mark.soak
def test_hardly_anything_is_invented() -> None:
    false = {FIRST_SEED + number: one.false for number, one in enumerate(verdicts()) if one.false}
    assert sum(map(len, false.values())) <= MOST_FALSE, false


@pytest.mark.soak
def test_corners_are_as_good_as_those_of_a_fit_that_is_told_every_label() -> None:
    ours, told = (np.concatenate([of(one) for one in verdicts()]) for of in (_corners, _told))
    assert len(ours) > ROOMS
    assert ours.mean() < 1.2 * told.mean()


def _due(one: Verdict) -> tuple[str, ...]:
    return one.due


def _missed(one: Verdict) -> tuple[str, ...]:
    return one.missed


def _corners(one: Verdict) -> np.ndarray:
    return one.corners_m


def _told(one: Verdict) -> np.ndarray:
    return one.label_fit_m
