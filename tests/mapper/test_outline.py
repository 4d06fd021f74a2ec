"""Walls that meet, end to start, as rings and open chains of points."""

import numpy as np
import pytest

from noctule_mapper.contour.outline import OutlineError, outlines

SQUARE = [((0, 0), (1, 0)), ((1, 0), (1, 1)), ((1, 1), (0, 1)), ((0, 1), (0, 0))]


def test_walls_that_meet_all_round_are_one_ring_of_their_corners():
    corners = [(1, 0, (0, 1)), (1, 1, (1, 2)), (0, 1, (2, 3)), (0, 0, (3, 0))]
    (ring,) = outlines(SQUARE, corners)
    assert ring.closed and ring.walls == (0, 1, 2, 3)
    np.testing.assert_array_equal(ring.points, [(0, 0), (1, 0), (1, 1), (0, 1)])


def test_a_gap_leaves_an_open_chain_from_the_wall_after_it_to_the_wall_before_it():
    corners = [(1, 1, (1, 2)), (0, 0, (3, 0)), (0, 1, (2, 3))]
    (chain,) = outlines(SQUARE, corners)
    assert not chain.closed and chain.walls == (1, 2, 3, 0)
    np.testing.assert_array_equal(chain.points, [(1, 0), (1, 1), (0, 1), (0, 0), (1, 0)])


def test_walls_that_meet_nothing_are_chains_of_their_own():
    found = outlines(SQUARE, [(1, 1, (1, 2))])
    assert [one.walls for one in found] == [(0,), (1, 2), (3,)]
    np.testing.assert_array_equal(found[0].points, SQUARE[0])
    assert outlines([], []) == []


@pytest.mark.parametrize(
    ("corners", "complaint"),
    [
        ([(1, 0, (0, 4))], "there are 4 walls"),
        ([(1, 0, (0, 1)), (1, 1, (0, 2))], "another corner"),
        ([(1, 0, (0, 1)), (1, 1, (2, 1))], "another corner"),
    ],
)
def test_corners_that_can_not_be_of_these_walls_are_refused(corners, complaint):
    with pytest.raises(OutlineError, match=complaint):
        outlines(SQUARE, corners)
