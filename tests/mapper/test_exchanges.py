"""Exchanges: what greedy search has missed of rooms with units that stand still, and what it must not make up."""

import numpy as np
import pytest
from mapper.fixed_units import Verdict, fixed_room, judge_fixed, survey_fixed
from mapper.test_linking import one_plateau

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.corners import link_ends
from noctule_mapper.contour.reflectors import Crossing, Line, Reflector, Spot
from noctule_mapper.contour.silence import silence_of
from noctule_mapper.mapper import Mapper
from noctule_mapper.refinement.exchanges import met_walls
from noctule_mapper.refinement.model_selection import sure_stretch

CONFIG = MapperConfig()
SOUTH, EAST = Line(-np.pi / 2, 0.0, 0.0, 1.0), Line(0.0, 4.0, 2.5, 3.0)


def verdict_of(seed: int) -> Verdict:
    """On the contour of a room that once went wrong."""
    rng = np.random.default_rng(seed)
    room, poses = fixed_room(rng)
    surveyed = survey_fixed(room, poses, rng)
    mapper = Mapper()
    for one in surveyed:
        mapper.register_sweep(one.sweep)
    return judge_fixed(mapper.contour(), room, surveyed)


@pytest.mark.parametrize(
    ("seed", "what"),
    [
        (20012, "cylinder 0"),  # a wall of two feet in one spot had taken its echoes
        (20058, "cylinder 1"),  # no triple of ranges that was tried had made it
        (20147, "corner 2"),  # acute, of a wall whose direction was 0.6 degrees off: 10 cm at the corner
        (20026, "wall 1"),  # two points had taken its echoes and its corner's
    ],
)
def test_what_greedy_search_misses_is_found(seed: int, what: str) -> None:
    verdict = verdict_of(seed)
    assert what in verdict.due
    assert not verdict.missed
    assert not verdict.false


@pytest.mark.parametrize(
    "seed",
    [
        20089,  # two walls linked past a third, which nobody hears
        20074,  # a corner's two echoes as a wall of 11 cm
        20091,  # a wall that ended with the echo of its corner, 7 cm beyond
        60003,  # one that ended with such an echo 21 cm beyond: its direction was 5.5 degrees off
        60156,  # an acute corner's three echoes as a cylinder
    ],
)
def test_what_is_not_there_is_not_made_up(seed: int) -> None:
    assert not verdict_of(seed).false


def test_walls_turn_to_meet_where_their_corner_was_heard() -> None:
    # The corner is at (4, 0); the east wall is known by what one plateau says, and errs by 2 degrees.
    heard = one_plateau(float(np.arctan2(-2.5, 3.0)), float(np.hypot(3.0, 2.5)))  # from (1, 2.5)
    turned = np.radians(2.0)
    east = Line(turned, 4.0 * np.cos(turned) + 2.5 * np.sin(turned), 2.5, 3.0)  # about (4, 2.5)
    objects: list[Reflector] = [SOUTH, east, Spot(4.0, 0.0)]
    off_m = np.hypot(*(Crossing(SOUTH, east).point - (4.0, 0.0)))
    assert off_m > 0.08
    made = [np.zeros(1, bool), np.zeros(1, bool), np.ones(1, bool)]
    (met,) = met_walls(objects, [1], made, np.zeros(1, bool), heard, CONFIG)
    first, second = met  # the point has gone
    assert isinstance(first, Line)
    assert isinstance(second, Line)
    assert np.hypot(*(Crossing(first, second).point - (4.0, 0.0))) < 0.1 * off_m


def test_walls_do_not_turn_to_what_was_heard_elsewhere() -> None:
    # Well known walls: their own feet have been heard, and the echo is 0.3 m short of their corner.
    heard = one_plateau(float(np.arctan2(-2.5, 3.0)), float(np.hypot(3.0, 2.5)) - 0.3)
    south, east = one_plateau(-np.pi / 2, 2.5), one_plateau(0.0, 3.0)
    data = heard.take(np.array([0, 0, 0]))
    for row, other in enumerate((south, east)):
        data.echoes.axis_rad[row], data.echoes.range_m[row] = other.echoes.axis_rad[0], other.echoes.range_m[0]
    made = list(np.eye(3, dtype=bool))
    objects: list[Reflector] = [SOUTH, EAST, Spot(3.8, 0.2)]
    assert list(met_walls(objects, [0, 1], made, np.zeros(3, bool), data, CONFIG)) == []


def test_a_wall_whose_feet_are_in_one_spot_is_dearer_than_a_long_one() -> None:
    data, prices, limits = one_plateau(0.0, 3.0), CONFIG.refinement.prices, CONFIG.refinement.limits
    behind = -5.0  # behind the unit's back: no look costs anything
    spot, half, long = (
        silence_of(Line(np.pi / 2, 9.0, behind, behind + length_m), data, CONFIG.refinement)
        for length_m in (0.0, limits.short_wall_m / 2, limits.short_wall_m)
    )
    assert (spot, half, long) == pytest.approx((prices.close_feet_nats, prices.close_feet_nats / 2, 0.0))


@pytest.mark.parametrize(("south_ends_m", "linked"), [(3.9, True), (1.0, False)])
def test_a_corner_nobody_heard_is_made_where_no_wall_can_lie_between(south_ends_m: float, linked: bool) -> None:
    """With 2 m unseen of the east wall: a link costs 7.5 and 2 nats a metre, and 3.5 nats for each metre that is unseen
    of both walls; an open end costs 15.
    """
    data = one_plateau(np.pi / 2, 0.5)
    south, east = Line(-np.pi / 2, 0.0, 0.0, south_ends_m), Line(0.0, 4.0, 2.0, 3.0)
    assert bool(link_ends({0: south, 1: east}, data, CONFIG.refinement)) == linked


def test_an_open_end_is_stated_as_far_as_the_wall_surely_goes() -> None:
    # Two feet 2 m apart, heard from 0.5 and 2.5 m with 3.2 mm: sqrt(2 R sigma) is 5.7 and 12.6 cm.
    data = one_plateau(-np.pi / 2, 2.5).take(np.array([0, 0]))
    data.echoes.x_m[1], data.echoes.y_m[1], data.echoes.range_m[1], data.stand[1] = 3.0, 0.5, 0.5, 1
    data.range_sigma_m[:] = 0.0032
    sure = sure_stretch(Line(-np.pi / 2, 0.0, 1.0, 3.0), data)
    assert (sure.low_m, sure.high_m) == pytest.approx((1.126, 2.943), abs=0.002)


def test_an_open_end_is_stated_as_far_in_as_the_direction_of_its_last_foot_says() -> None:
    """Off by t = 5 degrees to the inside, known to 1.5: d solves (d^2 / (2 R sigma))^2 + ((d / R - t) / sigma_t)^2 =
    (t / sigma_t)^2 + 1 = 12.11 with R = 2.5 m and sigma = 3.2 mm: at 0.235 m the left side is 11.99.
    """
    data = one_plateau(-np.pi / 2, 2.5).take(np.array([0, 0]))
    data.echoes.x_m[1], data.echoes.y_m[1], data.echoes.range_m[1], data.stand[1] = 3.0, 0.5, 0.5, 1
    data.range_sigma_m[:], data.direction_sigma_rad[:] = 0.0032, np.radians(1.5)
    wall = Line(-np.pi / 2, 0.0, 1.0, 3.0)
    data.echoes.axis_rad[0] += np.radians(5)  # to higher x: the wall goes from 1 to 3 m
    assert sure_stretch(wall, data).low_m == pytest.approx(1.235, abs=0.005)
    data.echoes.axis_rad[0] -= np.radians(10)  # off to the outside, it says nothing of a corner
    assert sure_stretch(wall, data).low_m == pytest.approx(1.126, abs=0.002)


def test_a_wall_of_feet_in_one_spot_ends_before_them_if_its_corner_is_known() -> None:
    # sqrt(2 R sigma) of 2.5 m and 3.2 mm is 12.6 cm; the foot is 2 m from the corner at 3 m, at (1, 0).
    data = one_plateau(-np.pi / 2, 2.5).take(np.array([0, 0]))
    data.range_sigma_m[:] = 0.0032
    foot = Line(-np.pi / 2, 0.0, 1.0, 1.0)
    assert (sure_stretch(foot, data).low_m, sure_stretch(foot, data).high_m) == pytest.approx((1.0, 1.0))
    assert sure_stretch(foot, data, [3.0]).low_m == pytest.approx(1.126, abs=0.002)
    assert sure_stretch(foot, data, [-1.0]).high_m == pytest.approx(0.874, abs=0.002)
