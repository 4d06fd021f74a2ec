"""The yardstick of maps by tape measure: the fit that is told every label, but no pose."""

import numpy as np
import pytest
from mapper.fixed_units import FIXED, cylinders_near_m_of, stated_by_tape, survey_fixed, taped_room
from mapper.label_fit import LabelFit, label_fit, variances
from mapper.posed_label_fit import PosedLabelFit, posed_label_fit
from mapper.room import LabelledSweep, Room
from scipy.stats import chi2

ROOMS = range(5000, 5040)


@pytest.fixture(scope="module")
def fits() -> list[tuple[Room, np.ndarray, list[LabelledSweep], PosedLabelFit]]:
    taped = [taped_room(np.random.default_rng(seed)) for seed in ROOMS]
    return [(room, true, surveyed, posed_label_fit(room, surveyed, true)) for room, true, surveyed in taped]


def test_its_poses_err_as_it_says(fits):
    # Chi-square, 0.5 % on each side; of a room one pose, so that all are independent.
    squares = []
    for number, (_, true, _, fit) in enumerate(fits):
        error = (fit.poses - true)[number % len(true)]
        squares.append(error @ np.linalg.solve(fit.pose_covariances[number % len(true)], error))
    low, high = chi2.ppf((0.005, 0.995), 3 * len(squares))
    assert low < sum(squares) < high


def test_its_corners_err_as_it_says(fits):
    squares = []
    for room, _, _, fit in fits:
        variance = variances(fit.room.corner_covariances).sum(axis=1)
        known = variance < 0.04**2
        squares += list(((fit.room.corners - room.vertices) ** 2).sum(axis=1)[known] / variance[known])
    # Their mean over 150 corners, some thirty rooms' worth of independent ones: 1 to within a third.
    assert len(squares) > 100
    assert np.mean(squares) == pytest.approx(1, abs=0.35)


def test_of_poses_that_are_known_it_is_the_label_fit():
    room = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
    true = np.array([(0.3, 0.6, 0.5), (3.7, 0.8, 2.6), (3.5, 2.6, -2.2), (0.6, 2.7, -0.9)])
    surveyed = survey_fixed(room, true, np.random.default_rng(1), FIXED)
    sure = stated_by_tape(surveyed, true, sigma_m=1e-6, sigma_rad=1e-6)
    posed, told = posed_label_fit(room, sure, true), label_fit(room, surveyed)
    assert posed.poses == pytest.approx(true, abs=1e-4)
    # The one is moved as a whole so that its corners fit best, so it is a little nearer.
    ours, theirs = (((fit.corners - room.vertices) ** 2).sum() for fit in (posed.room, told))
    assert 0.2 * theirs < ours <= 1.01 * theirs


def test_a_cylinder_that_is_due_is_found_as_near_as_this_fit_knows_it():
    # Three sigmas of the coordinate that is known worst, at least 5 cm and at most 10.
    sigma_m = np.array([(0.01, 0.01, 0.01), (0.02, 0.025, 0.02), (0.06, 0.02, 0.05), (40.0, 15.0, 0.04), (np.nan,) * 3])
    none = np.zeros((0, 2, 2))
    covariances = np.array([np.diag(one**2) for one in sigma_m])
    told = LabelFit(none[:, 0], none, none[:, 0], none, np.zeros((5, 3)), covariances)
    assert cylinders_near_m_of(told, np.array([True] * 4 + [False])) == pytest.approx([0.05, 0.075, 0.1, 0.1, 0.05])
    assert cylinders_near_m_of(told, np.zeros(5, bool)) == [0.05] * 5
