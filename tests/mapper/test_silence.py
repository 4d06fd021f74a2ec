"""What it costs to claim a reflector where somebody looked and did not hear it."""

import numpy as np
import pytest
from mapper.fixed_units import FIXED, survey_fixed
from mapper.room import Physics, Room
from mapper.test_plateaus import heard

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.reflectors import Circle, Crossing, Line, Spot
from noctule_mapper.contour.silence import silence_of, silence_of_link, silence_of_stretch
from noctule_mapper.readings.evidence import Evidence

CONFIG = RefinementConfig()
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
SOUTH, EAST = Line(-np.pi / 2, 0.0, -2.0, 2.0), Line(0.0, 4.0, 0.5, 2.5)
CLEAN = Physics(sigma_m=0.0032, lobe=FIXED.lobe)
ONE_LOOK_NATS = -np.log(1 - CONFIG.beam.wall_chance)  # of a look that a wall should have answered


def from_place(x_m: float, y_m: float, heading_rad: float) -> Evidence:
    return heard(survey_fixed(ROOM, np.array([(x_m, y_m, heading_rad)]), np.random.default_rng(1), CLEAN))


def test_a_wall_that_is_there_costs_nothing() -> None:
    data = from_place(2.0, 1.5, -np.pi / 2)
    # South's tangent is (1, 0): along it, the place's foot lies at 2 m.
    assert silence_of(Line(-np.pi / 2, 0.0, 0.5, 3.5), data, CONFIG) == 0.0


def test_a_wall_in_the_middle_of_the_room_costs_the_looks_that_go_through_it() -> None:
    data = from_place(2.0, 1.5, -np.pi / 2)
    false = Line(-np.pi / 2, -0.8, 0.5, 3.5)  # at y = 0.8, 0.7 m before the place, which hears the wall behind it
    assert silence_of(false, data, CONFIG) > 2 * ONE_LOOK_NATS


def test_a_stretch_costs_nothing_where_nobody_looked() -> None:
    data = from_place(2.0, 1.5, -np.pi / 2)
    false = Line(-np.pi / 2, -0.8)
    assert silence_of_stretch(false, 0.5, 1.5, data, CONFIG) == 0.0  # no look has its foot there
    assert silence_of_stretch(false, 1.5, 2.5, data, CONFIG) > 0.0


def test_looks_to_the_other_side_say_nothing() -> None:
    up = from_place(2.0, 1.5, np.pi / 2)  # its sweep ends 45 degrees short of straight down
    assert silence_of(Line(-np.pi / 2, -0.8, 0.5, 3.5), up, CONFIG) == 0.0


def test_what_stands_behind_a_wall_is_not_missed() -> None:
    data = from_place(2.0, 1.5, -np.pi / 2)
    behind = Line(-np.pi / 2, 1.0, 0.5, 3.5)
    assert silence_of(behind, data, CONFIG) == 0.0  # the nearer wall answered
    beside = Circle(2.9, 0.6, 0.1)
    assert silence_of(beside, data, CONFIG) > ONE_LOOK_NATS
    aslant = Line(-np.pi / 4, (2.0 - 1.5) / np.sqrt(2) + 0.6, -3.0, 3.0)  # 0.6 m from the place, across its way
    assert silence_of(beside, data, CONFIG, [aslant]) == 0.0  # between place and cylinder


def test_what_stands_behind_a_cylinder_is_not_missed_though_no_look_heard_the_cylinder() -> None:
    data = from_place(2.0, 1.5, -np.pi / 2)
    false = Line(-np.pi / 2, -0.8, 1.5, 2.5)  # at y = 0.8, with all its looks' feet about (2, 0.8)
    before, beside, behind = Circle(2.0, 1.2, 0.1), Circle(2.3, 1.2, 0.1), Circle(2.0, 0.5, 0.1)
    missed = silence_of(false, data, CONFIG)
    assert missed > 2 * ONE_LOOK_NATS
    assert silence_of(false, data, CONFIG, [before]) == 0.0
    assert silence_of(false, data, CONFIG, [beside, behind]) == missed


def test_a_point_claims_nothing() -> None:
    assert silence_of(Spot(2.0, 0.8), from_place(2.0, 1.5, -np.pi / 2), CONFIG) == 0.0


@pytest.mark.parametrize(("x_m", "costs"), [(4.0, False), (3.0, True)])
def test_a_corner_costs_what_looks_into_it_do_not_hear(x_m: float, costs: bool) -> None:
    data = from_place(2.0, 1.5, -np.pi / 4)
    south, east = Line(-np.pi / 2, 0.0, 1.5, 2.5), Line(0.0, x_m, 1.2, 1.8)
    assert (silence_of_link(Crossing(south, east), data, CONFIG) > ONE_LOOK_NATS) == costs
