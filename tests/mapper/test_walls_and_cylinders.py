"""The paper's transforms and least squares on points whose line or circle is known."""

import numpy as np
import pytest

from noctule_mapper.config import CylinderConfig, WallConfig
from noctule_mapper.contacts import Kind
from noctule_mapper.cylinders import least_squares_circle, ransac_hough
from noctule_mapper.features import FeaturePoints
from noctule_mapper.walls import extended_hough, hough_peak, orthogonal_line

SIGMA_M = 0.0032  # Section V.A


def on_line(theta_rad: float, rho_m: float, along_m: np.ndarray) -> np.ndarray:
    normal, tangent = (
        np.array([np.cos(theta_rad), np.sin(theta_rad)]),
        np.array([-np.sin(theta_rad), np.cos(theta_rad)]),
    )
    return rho_m * normal + np.outer(along_m, tangent)


def features(points: np.ndarray) -> FeaturePoints:
    """Wall points heard from the origin."""
    n = len(points)
    return FeaturePoints(
        points[:, 0], points[:, 1], np.ones(n), np.full(n, Kind.WALL), np.arctan2(points[:, 1], points[:, 0])
    )


@pytest.mark.parametrize("theta_deg", [0, 1, 45, 89, 90, 135, 179])
def test_the_orthogonal_line_fits_walls_of_every_direction(theta_deg):
    theta, rho = orthogonal_line(*on_line(np.radians(theta_deg), 1.5, np.linspace(-1, 1, 9)).T)
    assert abs(np.sin(theta - np.radians(theta_deg))) < 1e-9
    assert abs(rho) == pytest.approx(1.5)


def test_the_peak_is_the_line_most_points_lie_on():
    points = np.vstack(
        [on_line(np.radians(60), 2.0, np.linspace(-1, 1, 12)), on_line(np.radians(150), 1.0, np.linspace(-1, 1, 7))]
    )
    theta, rho, votes = hough_peak(points[:, 0], points[:, 1], WallConfig())
    assert np.degrees(theta) == pytest.approx(60, abs=1)
    assert rho == pytest.approx(2.0, abs=0.02)
    assert votes >= 8


def test_the_extended_transform_takes_walls_one_by_one_and_turns_their_normals_out_of_the_room():
    rng = np.random.default_rng(2)
    true = [(np.radians(10), 2.0), (np.radians(100), 1.5), (np.radians(-170), 1.8)]
    points = np.vstack([on_line(theta, rho + rng.normal(0, SIGMA_M), np.linspace(-1, 1, 12)) for theta, rho in true])
    walls = extended_hough(features(points), SIGMA_M, WallConfig())
    assert len(walls) == 3
    found = sorted((wall.line.theta_rad, wall.line.rho_m) for wall in walls)
    # Each wall's points share one draw of the range error.
    for (theta, rho), (true_theta, true_rho) in zip(found, sorted(true), strict=True):
        assert theta == pytest.approx(true_theta, abs=1e-6)
        assert rho == pytest.approx(true_rho, abs=4 * SIGMA_M)


def test_the_least_squares_circle_is_exact_on_points_of_a_circle_and_of_half_of_one():
    # Eq. 16-23 with the misprints of 20-22 put right; Table III's cylinder.
    turn = np.linspace(0.3, 0.3 + np.pi, 9)
    x, y = 1.384 + 0.448 * np.cos(turn), 0.480 + 0.448 * np.sin(turn)
    assert least_squares_circle(x, y) == pytest.approx((1.384, 0.480, 0.448))


def test_two_cylinders_are_found_among_points_of_neither():
    rng = np.random.default_rng(4)
    turn = np.linspace(0, 2 * np.pi, 14, endpoint=False)
    rings = [
        np.stack([x + r * np.cos(turn), y + r * np.sin(turn)], axis=1) for x, y, r in ((0, 0, 0.3), (1.5, 0.5, 0.2))
    ]
    points = np.vstack([*rings, rng.uniform(-2, 2, (4, 2))]) + rng.normal(0, SIGMA_M, (32, 2))
    found = ransac_hough(points[:, 0], points[:, 1], SIGMA_M, CylinderConfig())
    assert len(found) == 2
    # Fourteen points all round, each with sigma: a centre's coordinate is good to sigma / sqrt(7); five of these.
    for (x, y, r), one in zip(
        ((0, 0, 0.3), (1.5, 0.5, 0.2)), sorted(found, key=lambda one: one.circle.x_m), strict=True
    ):
        assert one.circle.parameters == pytest.approx((x, y, r), abs=5 * SIGMA_M / np.sqrt(7))


def test_points_in_a_line_make_no_cylinder():
    points = on_line(0.4, 1.0, np.linspace(-1, 1, 12))
    assert ransac_hough(points[:, 0], points[:, 1], SIGMA_M, CylinderConfig()) == []
