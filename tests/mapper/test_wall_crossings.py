"""Corners where walls cross, which no unit need have heard."""

import math

import numpy as np
import pytest
from mapper.placed_units import EXACTLY, view_with

from noctule_mapper.placement.reflector_models import PlacedUnit, all_models, rows_of
from noctule_mapper.placement.wall_crossings import corners_at, wall_crossings


# Of walls y = 1 and others: alpha in degrees, rho, and where both are touched along their tangents.
@pytest.mark.parametrize(
    ("other", "touched_m", "place_m", "is_acute"),
    [
        ((0.0, 2.0), ((0.0, 0.0), (-1.0, -1.0)), [(2.0, 1.0)], [False]),
        ((0.0, 2.0), ((-3.0, 0.0), (-1.0, -1.0)), [], []),  # beyond the crossing too
        ((-30.0, 1.0), ((0.0, 0.0), (0.0, 0.0)), [(math.sqrt(3), 1.0)], [True]),
        ((-30.0, 1.0), ((-3.0, -3.0), (0.0, 0.0)), [(math.sqrt(3), 1.0)], [False]),  # an edge that juts out
        ((-30.0, 1.0), ((-1.78, -1.78), (0.0, 0.0)), [(math.sqrt(3), 1.0)], [False]),  # the same, 5 cm from it
        ((80.0, 2.0), ((0.0, 0.0), (0.0, 0.0)), [], []),  # nearly parallel
    ],
    ids=["right angle", "passing through", "60 degrees", "edge", "edge, one foot beside it", "flat"],
)
def test_walls_cross_where_both_may_end(
    other: tuple[float, float],
    touched_m: tuple[tuple[float, float], tuple[float, float]],
    place_m: list[tuple[float, float]],
    is_acute: list[bool],
) -> None:
    line = np.array([(math.pi / 2, 1.0), (math.radians(other[0]), other[1])])
    low_m, high_m = np.array(touched_m).T
    found = wall_crossings(line, np.zeros((2, 2, 2)), low_m, high_m, np.ones(2, bool))
    assert found.place_m == pytest.approx(np.reshape(place_m, (-1, 2)))
    assert found.is_acute.tolist() == is_acute


@pytest.mark.parametrize(("off_m", "is_there"), [(0.0, True), (0.3, False)])
def test_a_corner_that_one_unit_hears_is_where_walls_that_two_others_hear_cross(off_m: float, is_there: bool) -> None:
    """Walls y = 1 and x = 2. The corner is right ahead of a unit that hears neither."""
    one, other = view_with({90.0: 1.0}), view_with({0.0: 1.0})
    ahead = view_with({45.0: 1.5 * math.sqrt(2) + off_m})
    poses = np.array([(0.0, 0.0, 0.0), (1.0, -1.0, 0.0), (0.5, -0.5, 0.0)])
    units = [PlacedUnit(view, pose, EXACTLY) for view, pose in zip((one, other, ahead), poses, strict=True)]
    rows = rows_of(units, [((0, 0),), ((1, 0),), ((2, 0),)])
    found = corners_at(rows, all_models(rows))
    assert list(found.corner) == ([2] if is_there else [])
    assert found.walls.tolist() == ([[0, 1]] if is_there else [])
    assert (found.nats > 0) == is_there
