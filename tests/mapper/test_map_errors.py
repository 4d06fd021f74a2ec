"""What the map draws of its own errors: as wide as stated, where they are."""

from math import pi, radians

import numpy as np
import pytest

from noctule import rerun_paths, walls
from noctule.messages_pb2 import Contour, Corner, Cylinder, Point, Wall
from noctule_mapper.rerun_view.errors import draw_object_errors, wall_band_m


def wall_at(theta_rad: float, rho_m: float, from_m: float, to_m: float, covariance: np.ndarray) -> Wall:
    """A wall on the line of ``theta_rad`` and ``rho_m``, between two places along it."""
    foot = rho_m * np.array([np.cos(theta_rad), np.sin(theta_rad)])
    along = np.array([-np.sin(theta_rad), np.cos(theta_rad)])
    (x1, y1), (x2, y2) = foot + from_m * along, foot + to_m * along
    return Wall(
        theta_rad=theta_rad,
        rho_m=rho_m,
        start=Point(x_m=x1, y_m=y1),
        end=Point(x_m=x2, y_m=y2),
        covariance=covariance.ravel(),
    )


def strips_m(contour: Contour) -> list[np.ndarray]:
    """The lines of the errors."""
    ((path, drawn),) = draw_object_errors(contour)
    assert path == rerun_paths.ERRORS
    batches = {batch.component_descriptor().component: batch.as_arrow_array() for batch in drawn.as_component_batches()}
    return [np.array(strip) for strip in batches["LineStrips2D:strips"].to_pylist()]


def test_a_walls_error_is_that_of_lines_drawn_from_its_covariance() -> None:
    covariance = np.array([[4e-4, -3e-4], [-3e-4, 9e-4]])
    wall = wall_at(radians(35), 2.0, -1.0, 3.0, covariance)
    places_m = np.array([(wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m)])
    lines = np.random.default_rng(5).multivariate_normal([wall.theta_rad, wall.rho_m], covariance, 40_000)
    normals = np.stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])])
    off_m = lines[:, 1] - places_m @ normals  # from each place to each line
    assert [walls.sigma_m(wall, x_m, y_m) for x_m, y_m in places_m] == pytest.approx(off_m.std(axis=1), rel=0.02)


def test_the_band_of_a_wall_is_two_sigmas_to_each_side_and_opens_towards_its_ends() -> None:
    wall = wall_at(pi / 2, 1.0, -2.0, 2.0, np.diag([0.01**2, 0.02**2]))
    above, below = wall_band_m(wall)
    assert (above - below)[4] == pytest.approx([0.0, 4 * 0.02])  # in the middle, where turning does not matter
    assert (above - below)[0] == pytest.approx([0.0, 4 * np.hypot(0.02, 2.0 * 0.01)])


def test_corners_and_cylinders_have_ellipses_as_wide_as_their_errors() -> None:
    corner = Corner(x_m=1.0, y_m=2.0, covariance=np.diag([1e-4, 4e-4]).ravel())
    cylinder = Cylinder(x_m=-1.0, covariance=np.diag([9e-4, 1e-4, 25e-4]).ravel())
    first, second = strips_m(Contour(corners=[corner], cylinders=[cylinder]))
    assert np.ptp(first, axis=0) == pytest.approx([0.04, 0.08], rel=0.01)
    assert np.ptp(second, axis=0) == pytest.approx([0.12, 0.04], rel=0.01)
    assert (first.max(axis=0) + first.min(axis=0)) / 2 == pytest.approx([1.0, 2.0])


def test_what_states_no_error_has_none_drawn() -> None:
    contour = Contour(walls=[Wall(end=Point(x_m=1.0))], corners=[Corner()], cylinders=[Cylinder(radius_m=0.1)])
    assert strips_m(contour) == []
