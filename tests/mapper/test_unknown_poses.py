"""Units whose poses nobody has stated: found from shared walls where the room can tell, left open where it cannot."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from mapper.judged_poses import Unknown, unknown
from mapper.unknown_units import (
    IRREGULAR,
    NEAR_ITS_MIDDLE,
    Outcome,
    contour_of,
    erased,
    judged_room,
    outcome,
    rectangle,
    survey_unknown,
    units_anywhere,
)
from system.processes import two_processes

from noctule import bounds
from noctule_mapper.contour.contour import PoseState
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message

# Rooms that were judged before and never looked at while the mapper was made.
FIRST_SEED, ROOMS = 93_000, 10  # each kind of room once, random ones seven times
LEAST_FOUND = 0.5  # 22 of 32 are found; a room is lost as a whole: with one more, of six units, 16


@cache
def found_in(kind: str) -> tuple[Outcome, tuple[str, ...]]:
    """What is found of the units in a room of that kind, and what is said of those that are left open."""
    rng = np.random.default_rng(4)
    if kind == "irregular":
        room, poses = IRREGULAR, NEAR_ITS_MIDDLE
    else:
        room = {"square": rectangle(3.2, 3.2), "rectangle": rectangle(4.0, 3.0), "corridor": rectangle(16.0, 2.0)}[kind]
        poses = units_anywhere(room, rng, 4)
        if kind == "corridor":
            poses[:, 0] = rng.uniform(5, 11, 4)  # its ends are out of reach
    contour = contour_of(survey_unknown(room, poses, rng))
    bounds.check(contour_message(contour, "s"))
    return outcome(contour, poses), tuple(pose.detail for pose in contour.poses if pose.state is PoseState.OPEN)


def test_in_a_room_whose_walls_all_differ_every_unit_is_found() -> None:
    found, _ = found_in("irregular")
    assert found == Outcome(("u2", "u3", "u4", "u5"), (), ())


@pytest.mark.parametrize("kind", ["square", "rectangle", "corridor"])
def test_in_a_room_that_looks_the_same_turned_or_along_it_every_pose_stays_open_and_says_why(kind: str) -> None:
    """Krekovic, Dokmanic and Vetterli 2016 list such rooms."""
    found, said = found_in(kind)
    assert found == Outcome((), (), ("u2", "u3", "u4"))
    assert all(said)


def test_a_rectangle_is_said_to_look_the_same_from_several_places() -> None:
    assert any("looks the same from several places" in said for said in found_in("rectangle")[1])


def test_units_that_share_a_corner_alone_with_the_known_one_stay_open() -> None:
    """Five units about one corner agree; the known one hears another corner of the room, 8 degrees less wide."""
    room, poses = judged_room(111_096)
    contour = contour_of(survey_unknown(room, poses, np.random.default_rng(111_096)))
    assert outcome(contour, poses) == Outcome((), (), ("u2", "u3", "u4", "u5", "u6"))
    assert all("share too few walls with those whose poses are known" in pose.detail for pose in contour.poses[1:])


def test_units_that_are_not_found_change_nothing_of_the_contour() -> None:
    rng = np.random.default_rng(5)
    room = rectangle(4.0, 3.0)
    sweeps = survey_unknown(room, units_anywhere(room, rng, 3), rng)
    known = contour_of([sweep for sweep in sweeps if sweep.unit == "u1"])
    both = contour_of(sweeps)
    assert contour_message(replace(both, poses=()), "s") == contour_message(replace(known, poses=()), "s")
    assert {pose.unit for pose in both.poses if pose.state is PoseState.OPEN} >= {"u2", "u3"}


def test_without_any_known_pose_all_stay_open() -> None:
    rng = np.random.default_rng(6)
    sweeps = [erased(sweep) for sweep in survey_unknown(IRREGULAR, NEAR_ITS_MIDDLE[:2], rng)]
    contour = contour_of(sweeps)
    assert not contour.walls
    assert [(pose.state, pose.detail) for pose in contour.poses] == [
        (PoseState.OPEN, "no unit of the site has a known pose")
    ] * 2


def test_sweeps_of_unknown_units_come_and_go_like_others() -> None:
    rng = np.random.default_rng(4)
    sweeps = survey_unknown(IRREGULAR, NEAR_ITS_MIDDLE, rng)
    mapper = Mapper()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    assert mapper.contour().sweeps == len(sweeps)
    assert {sweep.identity: sweep for sweep in mapper.sweeps()} == {sweep.identity: sweep for sweep in sweeps}
    for sweep in sweeps:
        if sweep.unit != "u1":
            mapper.remove_sweep(sweep.identity)
    left = mapper.contour()
    assert left.sweeps == len([sweep for sweep in sweeps if sweep.unit == "u1"])
    assert {pose.unit for pose in left.poses} <= {"u1"}


def test_sweeps_of_a_unit_that_has_just_been_found_do_not_date_the_contour() -> None:
    """They came before the clock was set to a day earlier, and reach the map after those that came since."""
    rng = np.random.default_rng(4)
    sweeps = survey_unknown(IRREGULAR, NEAR_ITS_MIDDLE, rng)
    mapper = Mapper()
    for sweep in sweeps:
        if sweep.pose_is_unknown:
            mapper.register_sweep(replace(sweep, time_s=200_000.0, clock_epoch="before"))
    for sweep in sweeps:
        if not sweep.pose_is_unknown:
            mapper.register_sweep(replace(sweep, time_s=100_000.0, clock_epoch="since"))
    contour = mapper.contour()
    assert contour.sweeps == len(sweeps)  # all are found
    assert contour.time_s == 100_000.0


@cache
def rooms() -> list[Unknown]:
    with two_processes() as pool:
        return list(pool.map(unknown, range(FIRST_SEED, FIRST_SEED + ROOMS)))


@pytest.mark.soak
def test_no_pose_is_found_at_a_wrong_place() -> None:
    wrong = {one.seed: one.outcome.wrong for one in rooms() if one.outcome.wrong}
    assert not wrong


@pytest.mark.soak
def test_a_unit_that_would_stand_elsewhere_if_the_others_followed_it_stays_open() -> None:
    """A rectangle in which u4 was found at a wrong place before arrangements were challenged."""
    assert unknown(102_008).outcome.wrong == ()


@pytest.mark.soak
def test_nine_of_ten_found_poses_are_within_5_cm_and_2_degrees() -> None:
    right, inexact = (sum(len(getattr(one.outcome, kind)) for one in rooms()) for kind in ("right", "inexact"))
    assert inexact <= 0.1 * (right + inexact)


@pytest.mark.soak
def test_most_of_the_units_whose_places_the_room_can_tell_are_found() -> None:
    """Nine of ten are wanted; 142 of 157 were found in other rooms (accuracy.md)."""
    due = sum(len(one.tellable) for one in rooms())
    found = sum(len(set(one.outcome.right) & set(one.tellable)) for one in rooms())
    assert found >= LEAST_FOUND * due
