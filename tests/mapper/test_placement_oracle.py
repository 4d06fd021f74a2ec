"""The oracle that says which units a room can tell the place of, on rooms made by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.arrangement import POST, Group, Reflector, moved, true_groups
from mapper.arrangement_worth import worth_nats
from mapper.fixed_units import survey_fixed
from mapper.placement_oracle import MOST_ODDS, echoes_at, odds_elsewhere, scene_of, tellable
from mapper.rival_arrangements import SAME_M, SAME_RAD, rivals
from mapper.room import Room

# A square in which two sets of units each hear two posts that the other set is too far away from.
POSTS = ((1.0, 1.3, 0.05), (0.8, 3.0, 0.05), (3.5, 1.2, 0.05), (3.7, 3.3, 0.05))
SQUARE = Room(np.array([(0.0, 0.0), (4.4, 0.0), (4.4, 4.4), (0.0, 4.4)]), POSTS)
TWO_SETS = np.array([(1.3, 2.3, 2.0), (1.5, 1.9, 3.0), (3.0, 2.1, 0.5), (2.9, 2.5, -0.4), (3.2, 2.3, 1.0)])
L_SHAPE = Room(np.array([(0.0, 0.0), (3.4, 0.0), (3.4, 1.7), (1.5, 1.7), (1.5, 3.9), (0.0, 3.9)]))
IN_ITS_LEGS = np.array([(1.1, 0.9, 0.3), (0.8, 1.3, 1.9), (0.9, 2.2, 2.6), (1.9, 0.8, -0.6), (0.6, 0.7, 1.0)])


def test_two_sets_of_units_that_only_hear_posts_of_their_own_may_stand_turned_to_one_another() -> None:
    """By itself none of them could stand elsewhere: it would lose both posts. Three together lose nothing."""
    surveyed = survey_fixed(SQUARE, TWO_SETS, np.random.default_rng(1))
    found = rivals(scene_of(SQUARE, TWO_SETS, surveyed))
    assert (odds_elsewhere(found, 5) > MOST_ODDS).tolist() == [False, False, True, True, True]
    assert (odds_elsewhere([one for one in found if len(one.units) == 1], 5) < MOST_ODDS).all()
    best = next(one for one in found if one.units == (2, 3, 4))
    # They hear the room's four walls there as they do at their places.
    for true, there in zip(TWO_SETS[2:], best.poses[2:], strict=True):
        here, elsewhere = (sorted(_walls_m(SQUARE, pose)) for pose in (true, there))
        assert elsewhere == pytest.approx(here, abs=0.01)


def _walls_m(room: Room, pose: np.ndarray) -> list[float]:
    return [echo.range_m for (kind, _), echo in echoes_at(room, pose).items() if kind == "wall"]


def test_an_l_tells_where_its_units_stand() -> None:
    surveyed = survey_fixed(L_SHAPE, IN_ITS_LEGS, np.random.default_rng(1))
    assert tellable(L_SHAPE, IN_ITS_LEGS, surveyed) == ("u2", "u3", "u4", "u5")


def test_where_the_posts_are_not_heard_each_unit_of_the_square_has_a_rival() -> None:
    room = Room(SQUARE.vertices)
    scene = scene_of(room, TWO_SETS, survey_fixed(room, TWO_SETS, np.random.default_rng(1)))
    assert (odds_elsewhere(rivals(scene), 5)[1:] > MOST_ODDS).all()


def test_an_arrangement_is_worth_the_same_turned_and_shifted_as_a_whole() -> None:
    room, poses = L_SHAPE, IN_ITS_LEGS
    shift = np.array([1.0, -2.0, math.radians(40)])
    corners = moved(shift, np.column_stack([room.vertices, np.zeros(len(room.vertices))]))[:, :2]
    worth = []
    for one, stand in ((room, poses), (Room(corners), moved(shift, poses))):
        scene = scene_of(one, stand, survey_fixed(one, stand, np.random.default_rng(1)))
        worth.append(worth_nats(scene, stand, true_groups(scene))[0])
    assert worth[0] == pytest.approx(worth[1], abs=0.01)


def test_no_arrangement_counts_twice() -> None:
    """In a room that is nearly square many shifts, of turns by 180 and by -180 degrees too, end at the same poses."""
    room = Room(np.array([(0.0, 0.0), (4.4, 0.0), (4.43, 4.4), (0.0, 4.37)]))
    found = rivals(scene_of(room, TWO_SETS, survey_fixed(room, TWO_SETS, np.random.default_rng(1))))
    for at, one in enumerate(found):
        for other in found[:at]:
            off = np.abs(one.poses - other.poses)
            turn_rad = np.abs(np.remainder(off[:, 2] + np.pi, 2 * np.pi) - np.pi)
            is_same = (np.hypot(off[:, 0], off[:, 1]) < SAME_M).all() and (turn_rad < SAME_RAD).all()
            assert not (is_same and one.units == other.units), one.units


def test_a_room_where_nothing_is_heard_for_sure_tells_no_place() -> None:
    assert tellable(SQUARE, TWO_SETS, []) == ()


def test_echoes_that_do_not_fit_are_worth_what_they_are_worth_alone() -> None:
    """Posts of the one set taken for those of the other, metres away: four groups have to be taken apart."""
    scene = scene_of(SQUARE, TWO_SETS, survey_fixed(SQUARE, TWO_SETS, np.random.default_rng(1)))
    rest = [group for group in true_groups(scene) if group.which[0] != "cylinder"]
    pairs = [((unit, ("cylinder", post)), (unit + 2, ("cylinder", post + 2))) for unit in (0, 1) for post in (0, 1)]
    together = [Group(POST, pair, pair[0][1]) for pair in pairs]
    alone = [Group(POST, (echo,), echo[1]) for pair in pairs for echo in pair]
    worth = [worth_nats(scene, TWO_SETS, [*rest, *groups])[0] for groups in (together, alone)]
    assert worth[0] == pytest.approx(worth[1], abs=1e-6)


@pytest.mark.parametrize("which", [("wall", 3), ("corner", 0)])
def test_what_moved_and_other_units_do_not_hear_alike_is_one_reflector_on_either_side(which: Reflector) -> None:
    """Three units are turned by a right angle, so that their walls 0 and 1 lie on 1 and 2. What they call wall 3 or
    corner 0 is then not what the other two call so.
    """
    scene = scene_of(SQUARE, TWO_SETS, survey_fixed(SQUARE, TWO_SETS, np.random.default_rng(1)))
    poses = np.vstack([TWO_SETS[:2], moved(np.array([4.4, 0.0, np.pi / 2]), TWO_SETS[2:])])
    sides = {}
    for one in scene.all:
        for is_moved in (False, True):
            if members := tuple((unit, one) for unit in scene.hear(one) if (unit > 1) == is_moved):
                sides[one, is_moved] = Group(scene.shape_of(one), members, one, is_moved)
    for wall in (0, 1):
        there, left = sides.pop((("wall", wall), True)), sides[("wall", wall + 1), False]
        sides[("wall", wall + 1), False] = replace(left, members=left.members + there.members)
    two = [sides.pop((which, is_moved)) for is_moved in (False, True)]
    together = replace(two[0], members=two[0].members + two[1].members)
    rest = list(sides.values())
    worth = [worth_nats(scene, poses, [*rest, *groups], (2, 3, 4))[0] for groups in ([together], two)]
    assert worth[0] == pytest.approx(worth[1], abs=1e-6)
