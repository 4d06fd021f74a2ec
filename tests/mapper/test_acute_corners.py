"""An acute corner sounds like a cylinder: which of both the plateaus of a few places are of."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.test_one_sided import plateaus_of

from noctule_mapper.contour.reflectors import Circle, Line
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.refinement.model_selection import may_be_a_corner

# About the point (1, 1), which they see in directions 45 degrees apart.
PLACES_M = ((1.0, 0.0), (0.0, 0.0), (0.6, 0.2))
CYLINDER = Circle(1.0, 1.0, 0.2)


def hearing(factor: float = 1.0, nearer_m: float = 0.0, face_m: float = 0.0) -> Evidence:
    """What the places hear of the point: at so many times the distance, and nearer by so much. The sensor's face is
    ``face_m`` nearer to the point than the axis, from which ranges count.
    """
    away = [(x_m, y_m, math.atan2(1 - y_m, 1 - x_m), math.hypot(1 - x_m, 1 - y_m)) for x_m, y_m in PLACES_M]
    made = plateaus_of([(*one[:3], face_m + factor * (one[3] - face_m) - nearer_m) for one in away])
    return replace(made, echoes=replace(made.echoes, face_offset_m=np.full(len(away), face_m)))


@pytest.mark.parametrize(
    ("angle_deg", "face_m", "may_be"),
    [
        (70.0, 0.0, True),  # a corner's double bounce is heard at d sin(angle), d the distance to its point
        (50.0, 0.0, True),
        (47.0, 0.0, False),  # its factor, 0.73, is below 3/4
        (70.0, 0.02, True),
        (48.55, 0.02, False),  # its factor is 0.7495; if the offset counted with the distance, 0.7507 would fit best
    ],
)
def test_a_cylinder_that_an_acute_corner_explains_better_is_none(angle_deg: float, face_m: float, may_be: bool) -> None:
    made = hearing(factor=math.sin(math.radians(angle_deg)), face_m=face_m)
    assert may_be_a_corner(Circle(1.1, 1.05, 0.2), [], made) == may_be


def test_a_corner_is_heard_from_between_its_walls_only() -> None:
    """A fourth place sees the point 90 degrees from the first: no corner of 70 degrees, whatever the ranges."""
    factor = math.sin(math.radians(70))
    heard = [(1.0, 0.0, math.pi / 2, factor), (0.0, 0.0, math.pi / 4, math.sqrt(2) * factor), (0.0, 1.0, 0.0, factor)]
    assert not may_be_a_corner(Circle(1.1, 1.05, 0.2), [], plateaus_of(heard))
    assert may_be_a_corner(Circle(1.1, 1.05, 0.2), [], plateaus_of(heard[:2]))


def test_a_cylinder_that_three_places_tell_is_one() -> None:
    assert not may_be_a_corner(CYLINDER, [], hearing(nearer_m=0.2))
    assert not may_be_a_corner(CYLINDER, [Line(0.0, 1.5)], hearing(nearer_m=0.2))


def test_a_corner_on_a_known_wall_may_even_be_a_little_worse() -> None:
    """It has a parameter less than the circle. Four millimetres, at 3 mm, are no proof of a radius."""
    made = hearing(nearer_m=0.004)
    nearly_a_point = Circle(1.0, 1.0, 0.004)
    assert may_be_a_corner(nearly_a_point, [Line(0.0, 1.0)], made)
    assert not may_be_a_corner(nearly_a_point, [], made)
