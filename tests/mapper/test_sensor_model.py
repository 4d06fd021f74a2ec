"""The annular-sector model, Eq. 5-8 of Liu et al. 2019, with the misprint of Eq. 7 corrected."""

import numpy as np
import pytest

from noctule_mapper.fusion.sensor_model import (
    ARC_STEPS,
    FREE_LEVELS,
    arc_beliefs,
    arc_level,
    arc_masses,
    direction_trust,
    free_beliefs,
    free_level,
    free_mass,
    off_arc,
)

WIDTH_RAD, EPSILON_M, RANGE_M = np.radians(22.5), 0.002, 3.0  # Section II.A; Fig. 3 has R = 3 m


def test_on_the_axis_and_at_the_range_a_place_is_surely_occupied():
    assert arc_masses(RANGE_M, 0.0, RANGE_M, EPSILON_M, WIDTH_RAD) == pytest.approx((1, 0, 0))


def test_direction_doubt_goes_to_the_unknown_and_range_doubt_to_the_free():
    # Fig. 3(a): theta = 5 deg, so lambda = 1 - 2 * 5 / 22.5 = 0.5556; at half of eps both sides get half of it.
    trust = 1 - 10 / 22.5
    half = arc_masses(RANGE_M + EPSILON_M / 2, np.radians(5), RANGE_M, EPSILON_M, WIDTH_RAD)
    assert half == pytest.approx((trust / 2, trust / 2, 1 - trust))


def test_outside_the_beam_and_off_the_arc_a_reading_knows_nothing():
    distance_m = np.array([RANGE_M, RANGE_M + 0.01, RANGE_M - 0.01])
    angle_rad = np.radians([12, 0, 0])
    assert arc_masses(distance_m, angle_rad, RANGE_M, EPSILON_M, WIDTH_RAD) == pytest.approx(np.tile((0, 0, 1), (3, 1)))


def test_only_what_lies_before_the_arc_and_inside_the_beam_is_free():
    distance_m = np.array([1.0, 1.0, RANGE_M, RANGE_M + 1])
    angle_rad = np.radians([0, 12, 0, 0])
    assert free_mass(distance_m, angle_rad, RANGE_M, EPSILON_M, WIDTH_RAD) == pytest.approx((1, 0, 0, 0))


def test_trust_falls_evenly_from_the_axis_to_the_edge_of_the_beam_on_both_sides():
    angle_rad = np.radians([-11.25, -5.625, 0, 5.625, 11.25, 20])
    assert direction_trust(angle_rad, WIDTH_RAD) == pytest.approx((0, 0.5, 1, 0.5, 0, 0))


def test_the_grids_table_of_arcs_is_the_model_in_the_middle_of_each_level():
    for trust in (np.arange(ARC_STEPS) + 0.5) / ARC_STEPS:
        for off in (np.arange(ARC_STEPS) + 0.5) / ARC_STEPS:
            place = RANGE_M + off * EPSILON_M, (1 - trust) * WIDTH_RAD / 2
            level = arc_level(direction_trust(place[1], WIDTH_RAD), off_arc(place[0], RANGE_M, EPSILON_M))
            model = arc_masses(*place, RANGE_M, EPSILON_M, WIDTH_RAD)
            assert arc_beliefs(1.0)[level] == pytest.approx(model, abs=1e-9)


def test_the_grids_table_of_free_space_is_the_model_in_the_middle_of_each_level():
    for trust in (np.arange(FREE_LEVELS) + 0.5) / FREE_LEVELS:
        free = float(free_mass(1.0, (1 - trust) * WIDTH_RAD / 2, RANGE_M, EPSILON_M, WIDTH_RAD))
        assert free_beliefs(1.0)[free_level(free)] == pytest.approx((0, free, 1 - free))


def test_a_place_on_the_very_axis_has_the_highest_level_and_one_at_the_edge_of_an_arc_the_last():
    assert free_level(1.0) == FREE_LEVELS - 1
    assert arc_level(1.0, 1.0) == ARC_STEPS**2 - 1
