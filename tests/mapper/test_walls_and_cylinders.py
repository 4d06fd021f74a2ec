"""The paper's extended transforms and least squares on points whose line or circle is known."""

from dataclasses import replace

import numpy as np
import pytest

from noctule_mapper.config import CylinderConfig, WallConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.paper.cylinders import least_squares_circle, ransac_hough
from noctule_mapper.paper.features import FeaturePoints
from noctule_mapper.paper.walls import extended_hough, orthogonal_line

SIGMA_M = 0.0032  # Section V.A


def on_line(theta_rad: float, rho_m: float, along_m: np.ndarray) -> np.ndarray:
    normal, tangent = (
        np.array([np.cos(theta_rad), np.sin(theta_rad)]),
        np.array([-np.sin(theta_rad), np.cos(theta_rad)]),
    )
    return rho_m * normal + np.outer(along_m, tangent)


def features(points: np.ndarray, kind: Kind = Kind.WALL, sigma_m: np.ndarray | float = SIGMA_M) -> FeaturePoints:
    """Points (n, 2) heard from the origin."""
    one = np.ones(len(points))
    direction_rad = np.arctan2(points[:, 1], points[:, 0])
    return FeaturePoints(points[:, 0], points[:, 1], one, one.astype(int) * kind, direction_rad, one * sigma_m, one * 0)


def of_wall(theta_rad: float, rho_m: float, along_m: np.ndarray, errors_m: np.ndarray | float = 0.0) -> FeaturePoints:
    """Points of a wall, each heard square on."""
    points = on_line(theta_rad, rho_m, along_m) + np.multiply.outer(
        errors_m, np.array([np.cos(theta_rad), np.sin(theta_rad)])
    )
    return replace(features(points), direction_rad=np.full(len(points), theta_rad))


def of_ring(x_m: float, y_m: float, radius_m: float, turn_rad: np.ndarray) -> FeaturePoints:
    """Points of a cylinder at ``turn_rad`` about its axis, each heard square on, their places along it known to
    1 cm.
    """
    outwards = np.stack([np.cos(turn_rad), np.sin(turn_rad)], axis=1)
    ring = features(outwards * radius_m + (x_m, y_m), Kind.CYLINDER)
    return replace(ring, direction_rad=turn_rad - np.pi, sigma_along_m=np.full(len(turn_rad), 0.01))


def moved(points: FeaturePoints, steps_m: np.ndarray) -> FeaturePoints:
    return replace(points, x_m=points.x_m + steps_m[:, 0], y_m=points.y_m + steps_m[:, 1])


def together(*parts: FeaturePoints) -> FeaturePoints:
    names = FeaturePoints.__dataclass_fields__
    return FeaturePoints(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


@pytest.mark.parametrize("theta_deg", [0, 1, 45, 89, 90, 135, 179])
def test_the_orthogonal_line_fits_walls_of_every_direction(theta_deg):
    theta, rho = orthogonal_line(*on_line(np.radians(theta_deg), 1.5, np.linspace(-1, 1, 9)).T)
    assert abs(np.sin(theta - np.radians(theta_deg))) < 1e-9
    assert abs(rho) == pytest.approx(1.5)


def test_a_point_counts_by_its_error():
    # Two exact points on y = 1 and one of a hundred times their error beside them: the line hardly moves.
    x_m, y_m = np.array([-1.0, 1.0, 0.5]), np.array([1.0, 1.0, 1.3])
    theta, rho = orthogonal_line(x_m, y_m, np.array([0.001, 0.001, 0.1]))
    assert abs(np.cos(theta)) < 1e-3
    assert abs(rho) == pytest.approx(1.0, abs=1e-3)
    assert abs(orthogonal_line(x_m, y_m)[1]) > 1.03


def test_the_extended_transform_takes_walls_one_by_one_and_turns_their_normals_out_of_the_room():
    rng = np.random.default_rng(2)
    true = [(np.radians(10), 2.0), (np.radians(100), 1.5), (np.radians(-170), 1.8)]
    along = np.linspace(-1, 1, 12)
    walls = extended_hough(
        together(*(of_wall(theta, rho, along, rng.normal(0, SIGMA_M, 12)) for theta, rho in true)), WallConfig()
    )
    assert len(walls) == 3
    found = sorted((wall.line.theta_rad, wall.line.rho_m) for wall in walls)
    # Twelve points along 2 m: rho is good to sigma / sqrt(12), theta to that over 0.63 m; five of these.
    for (theta, rho), (true_theta, true_rho) in zip(found, sorted(true), strict=True):
        assert theta == pytest.approx(true_theta, abs=5 * SIGMA_M / np.sqrt(12) / 0.63)
        assert rho == pytest.approx(true_rho, abs=5 * SIGMA_M / np.sqrt(12))


def test_a_wall_s_covariance_is_that_of_its_errors():
    # The squared error over its variance has mean 1 per parameter; 400 of them tell it to 15 %.
    rng = np.random.default_rng(3)
    squares = []
    for _ in range(200):
        (wall,) = extended_hough(of_wall(0.3, 2.0, np.linspace(-1, 1, 9), rng.normal(0, SIGMA_M, 9)), WallConfig())
        error = wall.line.parameters - (0.3, 2.0)
        squares.append(error @ np.linalg.solve(wall.covariance, error) / 2)
    assert np.mean(squares) == pytest.approx(1, abs=0.25)


def test_a_point_on_a_wall_s_line_that_was_touched_in_another_direction_is_not_of_it():
    wall = of_wall(np.radians(90), 1.0, np.linspace(-0.5, 0.5, 6))
    aslant = replace(of_wall(np.radians(90), 1.0, np.array([0.8])), direction_rad=np.array([np.radians(70)]))
    (found,) = extended_hough(together(wall, aslant), WallConfig())
    assert list(found.members) == [0, 1, 2, 3, 4, 5]
    assert found.line.high_m - found.line.low_m == pytest.approx(1.0)


def test_the_least_squares_circle_is_exact_on_points_of_a_circle_and_of_half_of_one():
    # Eq. 16-23 with the misprints of 20-22 corrected; Table III's cylinder.
    turn = np.linspace(0.3, 0.3 + np.pi, 9)
    x, y = 1.384 + 0.448 * np.cos(turn), 0.480 + 0.448 * np.sin(turn)
    assert least_squares_circle(x, y) == pytest.approx((1.384, 0.480, 0.448))


def test_a_circle_s_point_counts_by_its_error():
    turn = np.linspace(0, 2 * np.pi, 9, endpoint=False)
    x, y = 0.3 * np.cos(turn), 0.3 * np.sin(turn)
    x[0] += 0.1
    sigma_m = np.where(np.arange(9) == 0, 0.3, SIGMA_M)
    assert least_squares_circle(x, y, sigma_m) == pytest.approx((0, 0, 0.3), abs=1e-4)


_EACH_SECTOR = np.arange(16) * np.pi / 8 + 0.15
ALL_ROUND = 1.2 * np.stack([np.cos(_EACH_SECTOR), np.sin(_EACH_SECTOR)], axis=1)


def about(x_m: float, y_m: float) -> np.ndarray:
    """Places all round (x_m, y_m), one in each sector."""
    return np.add(ALL_ROUND, (x_m, y_m))


def test_two_cylinders_are_found_among_points_of_neither():
    rng = np.random.default_rng(4)
    true = ((0, 0, 0.3), (1.5, 0.5, 0.2))
    rings = [of_ring(*circle, np.linspace(0, 2 * np.pi, 14, endpoint=False)) for circle in true]
    points = together(*rings, features(rng.uniform(-2, 2, (4, 2)), Kind.CYLINDER))
    points = moved(points, rng.normal(0, SIGMA_M, (32, 2)))
    found = ransac_hough(points, np.vstack([about(0, 0), about(1.5, 0.5)]), CylinderConfig())
    assert len(found) == 2
    # Fourteen points all round, each with sigma: a centre's coordinate is good to sigma / sqrt(7); five of these.
    for circle, one in zip(true, sorted(found, key=lambda one: one.circle.x_m), strict=True):
        assert one.circle.parameters == pytest.approx(circle, abs=5 * SIGMA_M / np.sqrt(7))


def test_points_in_a_line_make_no_cylinder():
    points = features(on_line(0.4, 1.0, np.linspace(-1, 1, 12)), Kind.CYLINDER)
    assert ransac_hough(points, np.zeros((1, 2)), CylinderConfig()) == []


def test_half_a_cylinder_is_one_where_nobody_was_behind_it_and_none_where_somebody_was_all_about():
    # Section IV.D.1: the proportion is over the sectors that should contain points: those towards the survey's places.
    points = of_ring(0, 0, 0.4, np.linspace(-0.5, 0.5, 6))
    before = about(0, 0)[np.abs(np.arctan2(np.sin(_EACH_SECTOR), np.cos(_EACH_SECTOR))) < 0.6]
    (found,) = ransac_hough(points, before, CylinderConfig())
    assert found.circle.parameters == pytest.approx((0, 0, 0.4), abs=1e-6)
    assert ransac_hough(points, about(0, 0), CylinderConfig()) == []


def test_points_touched_past_the_centre_are_of_no_cylinder():
    # A corner's echoes, judged round by mistake, lie on a circle too, but were not touched towards its centre.
    ring = of_ring(0, 0, 0.4, np.linspace(0, 2 * np.pi, 12, endpoint=False))
    astray = replace(ring, direction_rad=ring.direction_rad + np.radians(25))
    assert len(ransac_hough(ring, about(0, 0), CylinderConfig())) == 1
    assert ransac_hough(astray, about(0, 0), CylinderConfig()) == []


def test_of_the_fullest_circles_the_most_even_is_taken():
    # A ring with a point in each sector, and one as full with all its points in three of them.
    even = of_ring(0, 0, 0.3, np.arange(16) * np.pi / 8 + 0.1)
    bunched = np.repeat([0.1, 2.2, 4.3], (5, 5, 6)) + np.tile(np.linspace(0, 0.2, 4), 4)
    places = np.vstack([about(3, 0), about(0, 0)])
    points = together(of_ring(3, 0, 0.3, bunched), even)
    found = ransac_hough(points, places, CylinderConfig(least_filled=0))
    assert [one.circle.x_m for one in found] == pytest.approx([0, 3], abs=1e-6)
