"""The baseline: plain and randomised Hough transforms on points whose lines and circles are known."""

import numpy as np
import pytest
from mapper.test_walls_and_cylinders import of_wall, on_line, together

from noctule_mapper.config import HoughConfig
from noctule_mapper.paper.hough import hough_cylinders, hough_walls
from noctule_mapper.paper.hough_transform import (
    line_accumulator,
    line_peaks,
    randomised_circle,
    randomised_line_accumulator,
)

SIGMA_M = 0.0032  # Section V.A
BIN_RAD, BIN_M = np.radians(1), 0.01
ALONG_M = np.linspace(-1, 1, 12)


def test_a_point_votes_along_its_sinusoid():
    # Eq. 9 at (0.3, 0.4): rho is 0.3 at theta 0, 0.5 at theta atan(4 / 3) = 53.13 degrees, 0.4 at 90.
    accumulator = line_accumulator(np.array([0.3]), np.array([0.4]), BIN_RAD, BIN_M)
    assert accumulator.votes.sum() == 180
    for theta_deg, rho_m in ((0, 0.3), (53, 0.5), (90, 0.4)):
        column = np.abs(accumulator.rho_m - rho_m).argmin()
        assert accumulator.votes[theta_deg, column] == 1
        assert accumulator.theta_rad[theta_deg] == pytest.approx(np.radians(theta_deg))


@pytest.mark.parametrize("theta_deg", [0, 45, 60, 135, 179])
@pytest.mark.parametrize("randomised", [False, True])
def test_the_peak_is_the_line_most_points_lie_on(theta_deg, randomised):
    points = np.vstack(
        [on_line(np.radians(theta_deg), 2.0, ALONG_M), on_line(np.radians(theta_deg + 80), 1.0, ALONG_M[:7])]
    )
    if randomised:
        accumulator = randomised_line_accumulator(
            points[:, 0], points[:, 1], BIN_RAD, BIN_M, 2000, np.random.default_rng(51)
        )
    else:
        accumulator = line_accumulator(points[:, 0], points[:, 1], BIN_RAD, BIN_M)
    theta, rho, votes = accumulator.peak()
    assert abs(np.sin(theta - np.radians(theta_deg))) < np.sin(1.01 * BIN_RAD)
    assert abs(rho) == pytest.approx(2.0, abs=0.02)
    assert votes >= 8


def test_a_peak_suppresses_its_like_also_across_theta_zero():
    # Lines at 0.4 and 179.6 degrees with opposite rho are nearly one.
    points = np.vstack([on_line(np.radians(0.4), 2.0, ALONG_M), on_line(np.radians(179.6), -2.0, ALONG_M)])
    accumulator = line_accumulator(points[:, 0], points[:, 1], BIN_RAD, BIN_M)
    peaks = line_peaks(accumulator, 8, np.radians(8), 0.15)
    assert len(peaks) == 1
    assert len(line_peaks(accumulator, 8, 0.0, 0.0)) > 1


@pytest.mark.parametrize("lines", ["standard", "randomised"])
def test_walls_are_as_good_as_their_bins(lines):
    rng = np.random.default_rng(52)
    true = [(np.radians(10.3), 2.004), (np.radians(100.4), 1.506), (np.radians(-169.7), 1.8)]
    points = together(*(of_wall(theta, rho, ALONG_M, rng.normal(0, SIGMA_M, 12)) for theta, rho in true))
    walls = hough_walls(points, HoughConfig(lines=lines))
    assert len(walls) == 3
    found = sorted((wall.line.theta_rad, wall.line.rho_m) for wall in walls)
    for (theta, rho), (true_theta, true_rho) in zip(found, sorted(true), strict=True):
        assert theta == pytest.approx(true_theta, abs=1.5 * BIN_RAD)
        assert rho == pytest.approx(true_rho, abs=1.5 * BIN_M)
        assert theta % BIN_RAD == pytest.approx(0, abs=1e-6) or theta % BIN_RAD == pytest.approx(BIN_RAD, abs=1e-6)


def test_random_triples_vote_for_the_circle_they_lie_on():
    rng = np.random.default_rng(53)
    turn = np.linspace(0, 2 * np.pi, 20, endpoint=False)
    ring = np.stack([1.384 + 0.448 * np.cos(turn), 0.480 + 0.448 * np.sin(turn)], axis=1)  # Table III
    points = np.vstack([ring, rng.uniform(-1, 3, (6, 2))]) + rng.normal(0, SIGMA_M, (26, 2))
    found = randomised_circle(points[:, 0], points[:, 1], 0.01, (0.02, 1.0), 4000, rng)
    assert found is not None
    assert found[:3] == pytest.approx((1.384, 0.480, 0.448), abs=0.015)
    assert found[:3] == pytest.approx(np.rint(np.array(found[:3]) / 0.01) * 0.01)


def test_two_cylinders_come_one_after_the_other_and_a_line_is_none():
    rng = np.random.default_rng(54)
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    true = ((0, 0, 0.3), (1.5, 0.5, 0.2))
    rings = [np.stack([x + r * np.cos(turn), y + r * np.sin(turn)], axis=1) for x, y, r in true]
    points = np.vstack(rings) + rng.normal(0, SIGMA_M, (32, 2))
    wall = of_wall(0.4, 1.0, ALONG_M)
    ring = together(*(of_wall(0.0, x, np.array([y])) for x, y in points))
    found = sorted(one.circle.x_m for one in hough_cylinders(ring, HoughConfig()))
    assert found == pytest.approx([0, 1.5], abs=0.015)
    assert hough_cylinders(wall, HoughConfig()) == []
