"""The detectable radius of Section V.C against the paper's own numbers and against the geometry it stands for."""

import numpy as np
import pytest

from noctule_mapper.paper.detectable import deviation_m, greatest_radius_as_printed_m, greatest_radius_m

SIGMA_M, STEP_M = 0.0032, 0.2  # d = sigma = 0.32 cm, l_step = 20 cm: Section V.C


@pytest.mark.parametrize("distance_m", [0.3, 0.7, 1.0])
def test_as_printed_it_is_312_5_cm_less_the_distance_and_104_16_at_three_sigma(distance_m):
    # Eq. 25; the paper prints 104.16 for 104.1666...
    assert greatest_radius_as_printed_m(distance_m, STEP_M, SIGMA_M) == pytest.approx(3.125 - distance_m)
    assert greatest_radius_as_printed_m(distance_m, STEP_M, 3 * SIGMA_M) == pytest.approx(1.0416 - distance_m, abs=1e-4)


def test_put_right_it_is_625_cm_less_the_distance():
    assert greatest_radius_m(0.3, STEP_M, SIGMA_M) == pytest.approx(6.25 - 0.3 + SIGMA_M / 2)


@pytest.mark.parametrize("distance_m", [0.3, 0.7, 1.5])
def test_put_right_it_is_the_radius_whose_deviation_is_the_threshold(distance_m):
    radius_m = greatest_radius_m(distance_m, STEP_M, SIGMA_M)
    # L of Eq. 24 is the range of the outer positions, the middle one is d nearer.
    assert deviation_m(radius_m, distance_m - SIGMA_M, STEP_M) == pytest.approx(SIGMA_M)
    printed_m = greatest_radius_as_printed_m(distance_m, STEP_M, SIGMA_M)
    assert deviation_m(printed_m, distance_m - SIGMA_M, STEP_M) == pytest.approx(2 * SIGMA_M, rel=0.01)


def test_it_falls_with_deviation_and_distance_and_grows_with_the_step():
    # "the detection radius R of the cylinder will reduce with d increasing, l_step decreases and L increasing"
    for radius_m in (greatest_radius_m, greatest_radius_as_printed_m):
        assert np.all(np.diff(radius_m(0.3, STEP_M, np.linspace(0.002, 0.01, 9))) < 0)
        assert np.all(np.diff(radius_m(np.linspace(0.3, 2, 9), STEP_M, SIGMA_M)) < 0)
        assert np.all(np.diff(radius_m(0.3, np.linspace(0.1, 0.4, 9), SIGMA_M)) > 0)


def test_beyond_104_cm_nothing_is_told_at_three_sigma_as_printed():
    assert greatest_radius_as_printed_m(1.05, STEP_M, 3 * SIGMA_M) < 0
