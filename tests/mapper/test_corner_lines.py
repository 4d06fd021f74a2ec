"""Lines through what was heard of a known wall's corner, in a corner worked out by hand."""

import math

import numpy as np
import pytest
from mapper.small_scene import evidence_of

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.reflectors import Line
from noctule_mapper.refinement.corner_lines import corner_lines

CONFIG = RefinementConfig()
# The wall x = 2 is known from y = -1 to 0.5, the wall y = 1.5 is not. They meet at (2, 1.5), 2.06 m from (0.6, 0).
KNOWN = Line(0.0, 2.0, -1.0, 0.5)
OF_THE_CORNER = (0.6, 0.0, math.atan2(1.5, 1.4), math.hypot(1.4, 1.5))
OF_THE_OTHER = (1.0, 0.3, math.pi / 2, 1.2)


def lines(*heard: tuple[float, float, float, float], free: tuple[bool, ...] = (True, True)) -> np.ndarray:
    return corner_lines([KNOWN], np.array(free), evidence_of(heard).echoes, CONFIG)


def test_one_echo_of_a_wall_and_one_of_its_corner_make_a_line() -> None:
    found = lines(OF_THE_CORNER, OF_THE_OTHER)
    assert np.abs(found - (math.pi / 2, 1.5)).max(axis=1).min() < 1e-9


def test_an_echo_that_is_explained_is_of_no_other_corner() -> None:
    assert len(lines(OF_THE_CORNER, OF_THE_OTHER, free=(False, True))) == 0


def test_no_corner_lies_within_what_has_been_seen_of_a_wall() -> None:
    # 1.4 m before the wall, and heard of it at (2, -0.3) in a beam towards it: 0.7 m from its nearer end.
    assert len(lines((0.6, -0.3, 0.0, 1.401), OF_THE_OTHER)) == 0


@pytest.mark.parametrize("turned_rad", [0.5, -0.5])
def test_a_line_touches_its_arc_inside_the_beam(turned_rad: float) -> None:
    x_m, y_m, axis_rad, range_m = OF_THE_OTHER
    found = lines(OF_THE_CORNER, (x_m, y_m, axis_rad + turned_rad, range_m))
    assert not len(found) or np.abs(found - (math.pi / 2, 1.5)).max(axis=1).min() > 0.1
