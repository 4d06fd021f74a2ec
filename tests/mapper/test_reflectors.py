"""Every derivative of every reflector against a central difference of what it is the derivative of."""

from dataclasses import replace

import numpy as np
import pytest
from mapper.made_echoes import made_echoes

from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Reflector, Spot
from noctule_mapper.readings.echoes import Echoes

STEP = 1e-6
# A central difference of step h errs by about h^2 times the third derivative, and rounding by 1e-16 / h.
NEAR = 1e-7
PLACES = np.array([(0.3, -0.2), (-1.1, 0.4), (0.8, 1.3), (-0.5, -1.7)])


AXIS_RAD = np.array([0.2, -2.0, 1.1, 2.8])
FACE_M = 0.03  # off the axis


def echoes() -> Echoes:
    return made_echoes(PLACES, np.ones(len(PLACES)), AXIS_RAD, sigma_m=1.0, half_beam_rad=1.0, face_offset_m=FACE_M)


REFLECTORS = [Line(0.4, 2.5), Line(-2.9, 3.0), Circle(2.5, 1.0, 0.3), Spot(-2.0, 2.2)]


@pytest.mark.parametrize("one", REFLECTORS)
@pytest.mark.parametrize(("of", "slopes"), [("ranges", "slopes"), ("directions", "direction_slopes")])
def test_slopes_are_the_derivatives(one: Reflector, of: str, slopes: str) -> None:
    numeric = [
        (getattr(one.moved(step), of)(echoes()) - getattr(one.moved(-step), of)(echoes())) / (2 * STEP)
        for step in STEP * np.eye(len(one.parameters))
    ]
    assert getattr(one, slopes)(echoes()) == pytest.approx(np.stack(numeric, axis=1), abs=NEAR)


# Walls that turn by 70 (an obtuse corner), 110 (an acute one, heard by double bounce) and -60 degrees (a reflex edge).
CROSSINGS = [Crossing(Line(0.3, 2.0), Line(0.3 + np.radians(turn), 2.4)) for turn in (70, 110, -60)]


def moved(corner: Crossing, step: np.ndarray) -> Crossing:
    return Crossing(corner.first.moved(step[:2]), corner.second.moved(step[2:]))


@pytest.mark.parametrize("corner", CROSSINGS)
@pytest.mark.parametrize(("of", "slopes"), [("ranges", "slopes"), ("directions", "direction_slopes")])
def test_slopes_of_a_corner_are_the_derivatives_by_both_walls(corner: Crossing, of: str, slopes: str) -> None:
    numeric = [
        (getattr(moved(corner, step), of)(echoes()) - getattr(moved(corner, -step), of)(echoes())) / (2 * STEP)
        for step in STEP * np.eye(4)
    ]
    assert getattr(corner, slopes)(echoes()) == pytest.approx(np.stack(numeric, axis=1), abs=NEAR)


@pytest.mark.parametrize("one", [*REFLECTORS, *CROSSINGS])
@pytest.mark.parametrize(("of", "slopes"), [("ranges", "slopes_by_place"), ("directions", "direction_slopes_by_place")])
def test_slopes_by_the_place_are_the_derivatives(one: Reflector | Crossing, of: str, slopes: str) -> None:
    heard, numeric = echoes(), []
    for dx_m, dy_m in STEP * np.eye(2):
        ahead, behind = (replace(heard, x_m=heard.x_m + sign * dx_m, y_m=heard.y_m + sign * dy_m) for sign in (1, -1))
        numeric.append((getattr(one, of)(ahead) - getattr(one, of)(behind)) / (2 * STEP))
    assert getattr(one, slopes)(heard) == pytest.approx(np.stack(numeric, axis=1), abs=NEAR)


@pytest.mark.parametrize("one", [*REFLECTORS, *CROSSINGS])
def test_a_range_is_that_from_the_face_and_the_face_s_offset(one: Reflector | Crossing) -> None:
    on_axis = replace(echoes(), face_offset_m=np.zeros(len(PLACES)))
    faces = PLACES + FACE_M * np.stack([np.cos(AXIS_RAD), np.sin(AXIS_RAD)], axis=1)
    there = replace(on_axis, x_m=faces[:, 0], y_m=faces[:, 1])
    assert one.ranges(echoes()) == pytest.approx(one.ranges(there) + FACE_M)
    assert one.directions(echoes()) == pytest.approx(one.directions(there))


@pytest.mark.parametrize("corner", CROSSINGS)
def test_a_corner_moves_with_its_walls_as_its_slopes_say(corner: Crossing) -> None:
    numeric = [(moved(corner, step).point - moved(corner, -step).point) / (2 * STEP) for step in STEP * np.eye(4)]
    assert corner.point_slopes() == pytest.approx(np.stack(numeric, axis=1), abs=NEAR)
