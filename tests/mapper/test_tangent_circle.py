"""Tangent circles: what each reading touched by the radius of the circle that its neighbours touch too, and its error.

The expected circles are those that the ranges are made from.
"""

import numpy as np
import pytest
from mapper.made_echoes import made_echoes
from mapper.room import HALF_BEAM_RAD, paper_path, paper_room, survey

from noctule_mapper.config import ContactConfig, MapperConfig
from noctule_mapper.contacts.contact_book import ContactBook
from noctule_mapper.contacts.tangent_circle import TangentCircles, tangent_circles
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.echoes import Echoes

CONFIG = ContactConfig()
SIGMA_M = 0.0032  # Section V.A
ALONG = np.stack([np.arange(-0.5, 0.51, 0.2), np.zeros(6)], axis=1)
_ASIDE_M = [(0, 0.05), (0.03, 0), (0, -0.1), (-0.02, 0.08), (0, 0), (0.05, -0.06)]
ASTRAY = np.add(ALONG, _ASIDE_M)  # no three on a line


def circles_of(heard: Echoes) -> TangentCircles:
    book = ContactBook(CONFIG)
    for number in range(len(heard)):
        one = heard.take(np.array([number]))
        book.add(("t", number), float(one.x_m[0]), float(one.y_m[0]), one)
    return tangent_circles(book.echoes(), book.echoes(), book.contacts(), CONFIG)


def of_circle(places: np.ndarray, centre: np.ndarray, radius_m: float, errors_m: np.ndarray) -> Echoes:
    away = centre - places
    return made_echoes(places, np.hypot(*away.T) - radius_m + errors_m, np.arctan2(away[:, 1], away[:, 0]), SIGMA_M)


def of_wall(places: np.ndarray, theta_rad: float, rho_m: float, errors_m: np.ndarray) -> Echoes:
    range_m = rho_m - places @ [np.cos(theta_rad), np.sin(theta_rad)]
    return made_echoes(places, range_m + errors_m, np.full(len(places), theta_rad), SIGMA_M)


NONE = np.zeros(6)


@pytest.mark.parametrize("places", [ALONG, ASTRAY])
def test_exact_readings_of_a_cylinder_know_its_radius_and_direction(places):
    centre, radius_m = np.array([0.1, 1.2]), 0.45
    found = circles_of(of_circle(places, centre, radius_m, NONE))
    assert list(found.kind) == [Kind.CYLINDER] * 6
    assert found.radius_m == pytest.approx(np.full(6, radius_m), abs=0.001)
    away = centre - places
    assert found.direction_rad == pytest.approx(np.arctan2(away[:, 1], away[:, 0]), abs=np.radians(0.05))
    assert list(found.supporters) == [5] * 6


@pytest.mark.parametrize("places", [ALONG, ASTRAY])
def test_exact_readings_of_a_wall_or_a_corner_are_of_that_kind_and_direction(places):
    wall = circles_of(of_wall(places, np.radians(80), 1.5, NONE))
    assert list(wall.kind) == [Kind.WALL] * 6
    assert wall.direction_rad == pytest.approx(np.full(6, np.radians(80)), abs=np.radians(0.01))
    corner = circles_of(of_circle(places, np.array([0.1, 1.0]), 0.0, NONE))
    assert list(corner.kind) == [Kind.CORNER] * 6
    away = np.array([0.1, 1.0]) - places
    assert corner.direction_rad == pytest.approx(np.arctan2(away[:, 1], away[:, 0]), abs=np.radians(0.01))


def test_errors_of_direction_and_radius_are_as_large_as_they_say():
    # The error over its sigma has mean square 1; six readings of a trial share theirs, so 100 trials tell it to 30 %.
    rng = np.random.default_rng(31)
    centre, radius_m = np.array([0.1, 1.2]), 0.45
    away = centre - ASTRAY
    turns, radii = [], []
    for _ in range(100):
        found = circles_of(of_circle(ASTRAY, centre, radius_m, rng.normal(0, SIGMA_M, 6)))
        round_ = found.kind == Kind.CYLINDER
        turn = found.direction_rad - np.arctan2(away[:, 1], away[:, 0])
        turns += list((turn / found.direction_sigma_rad)[round_])
        radii += list(((found.radius_m - radius_m) / found.radius_sigma_m)[round_])
    assert len(turns) > 550
    assert 0.7 < np.mean(np.square(turns)) < 1.3
    assert 0.7 < np.mean(np.square(radii)) < 1.4


@pytest.mark.parametrize("theta_deg", [60, 90, 120])
def test_noise_seldom_bends_a_wall(theta_deg):
    # Three sigma: 0.27 % of circles, were all judged alone; readings taken for outliers add a few.
    rng = np.random.default_rng(theta_deg)
    kinds = [
        kind
        for _ in range(50)
        for kind in circles_of(of_wall(ASTRAY, np.radians(theta_deg), 1.5, rng.normal(0, SIGMA_M, 6))).kind
    ]
    assert np.mean(np.array(kinds) == Kind.WALL) > 0.97


def test_a_stray_neighbour_does_not_turn_the_circle():
    errors_m = NONE.copy()
    errors_m[3] = 0.08
    found = circles_of(of_circle(ASTRAY, np.array([0.1, 1.2]), 0.45, errors_m)).take(np.array([0, 1, 2, 4, 5]))
    assert list(found.kind) == [Kind.CYLINDER] * 5
    assert found.radius_m == pytest.approx(np.full(5, 0.45), abs=0.005)


def test_what_two_readings_touch_has_no_kind():
    pair = of_wall(ALONG[:2], np.radians(90), 1.0, np.zeros(2))
    assert list(circles_of(pair).kind) == [Kind.NONE] * 2


def test_on_a_path_through_the_papers_room_the_cylinder_is_a_cylinder_and_walls_are_walls():
    ((x, y, radius_m),) = paper_room().cylinders
    mapper = Mapper(MapperConfig())
    for sweep in survey(paper_room(), paper_path(), np.random.default_rng(32)):
        mapper.register_sweep(sweep)
    report = mapper.contact_report()
    echoes, circles = report.echoes, report.circles
    of_cylinder = np.abs(np.hypot(x - echoes.x_m, y - echoes.y_m) - radius_m - echoes.range_m) < 4 * SIGMA_M
    turn = np.arctan2(y - echoes.y_m, x - echoes.x_m) - echoes.axis_rad
    of_cylinder &= np.abs(np.arctan2(np.sin(turn), np.cos(turn))) < HALF_BEAM_RAD
    assert of_cylinder.sum() > 30
    assert np.mean(circles.kind[of_cylinder] == Kind.CYLINDER) > 0.95
    assert np.median(np.abs(circles.radius_m[of_cylinder] - radius_m)) < 0.01
    assert np.mean(circles.kind[~of_cylinder] == Kind.CYLINDER) < 0.2
