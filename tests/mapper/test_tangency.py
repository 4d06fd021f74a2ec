"""The tangency equation and the choice of pairs, on circles whose contacts are known from where their centres lie."""

import math

import numpy as np
import pytest

from noctule_mapper.contacts.tangency import SIDES, direction_rad, other_direction_rad, turn_rad
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.pairs import may_share, near_pairs, offsets

PLACES_M = np.array([[0.0, 0.0], [0.5, 0.2]])


def heard_m(ranges_m: tuple[float, ...], places_m: np.ndarray = PLACES_M) -> Echoes:
    """Echoes (n,) from ``places_m`` (n, 2); only place and range matter here."""
    x_m, y_m = places_m.T
    one = np.ones(len(ranges_m))
    sure = np.ones(len(one), bool)
    return Echoes(sure, x_m, y_m, 0 * one, one, np.array(ranges_m), one, sure, one, one, one, one, one)


def both(echoes: Echoes, curvature_per_m: float) -> list[tuple[float, float]]:
    """The directions from the first place and from the second to either circle that both arcs touch."""
    between = offsets(echoes, np.array([0]), echoes, np.array([1]))
    turned_rad = turn_rad(between, curvature_per_m)
    found = []
    for side in SIDES:
        first = direction_rad(between, turned_rad, side)
        other = other_direction_rad(between, first, curvature_per_m)
        found.append((float(wrapped(first)[0]), float(wrapped(other)[0])))
    return found


@pytest.mark.parametrize("radius_m", [0.0, 0.2, 0.7])
def test_a_circle_is_touched_towards_its_centre_from_both_places(radius_m: float) -> None:
    # A point for radius 0. The range to a circle is the distance of its centre less the radius.
    centre_m = np.array([0.4, 1.5])
    away_m = np.hypot(*(centre_m - PLACES_M).T)
    towards = [math.atan2(*(centre_m - place)[::-1]) for place in PLACES_M]
    found = both(heard_m(tuple(away_m - radius_m)), 1 / away_m[0])  # s = 1 / (r + R)
    assert any(one == pytest.approx(towards, abs=1e-9) for one in found)


def test_a_wall_is_touched_along_its_normal_from_both_places() -> None:
    theta_rad, rho_m = 1.1, 2.0  # R = rho - n . p
    ranges_m = rho_m - PLACES_M @ np.array([math.cos(theta_rad), math.sin(theta_rad)])
    assert any(one == pytest.approx((theta_rad, theta_rad), abs=1e-9) for one in both(heard_m(tuple(ranges_m)), 0.0))


def test_arcs_whose_ranges_differ_by_more_than_their_places_share_no_circle() -> None:
    # The places are 0.539 m apart.
    assert np.isnan(both(heard_m((1.0, 1.6)), 0.0)).all()
    assert not np.isnan(both(heard_m((1.0, 1.5)), 0.0)).any()


@pytest.mark.parametrize(
    ("apart_m", "longer_m", "may"), [(0.05, 0.0, False), (0.2, 0.19, True), (0.2, 0.21, False), (1.4, 0.0, False)]
)
def test_pairs_are_neither_too_near_nor_too_far_nor_too_unlike(apart_m: float, longer_m: float, may: bool) -> None:
    echoes = heard_m((1.0, 1.0 + longer_m), np.array([[0.0, 0.0], [apart_m, 0.0]]))
    every = offsets(echoes, np.array([[0], [1]]), echoes, np.arange(2))
    by_matrix = may_share(every.baseline_m, every.longer_m, 0.1, 1.3)
    assert by_matrix.tolist() == [[False, may], [may, False]]
    i, j, baseline_m = near_pairs(echoes, echoes, 0.1, 1.3)
    assert sorted(zip(i.tolist(), j.tolist(), strict=True)) == ([(0, 1), (1, 0)] if may else [])
    assert baseline_m == pytest.approx([apart_m] * len(i))
