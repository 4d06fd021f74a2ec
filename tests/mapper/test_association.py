"""Who made which echo, in scenes worked out by hand from the rules at the head of the module association.

A maker that would answer with chance a is heard only if those before it are silent; a range worth g nats is exp(g)
times as likely as one from anywhere; a share of 0.04 of the echoes is false (BeamConfig.false_share).
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.small_scene import MOST_GAIN_NATS, evidence_of

from noctule_mapper.config import RefinementConfig
from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.reflectors import Circle, Line
from noctule_mapper.refinement.association import Claims, Scene, explain

CONFIG = RefinementConfig()
TRUE_SHARE = 0.96  # 1 - false_share
ASTRAY_NATS = -1000.0  # the worth of a range that is far from the maker's


def claims(maker: list[int], echo: list[int], predicted_m: list[float], chance: list[float]) -> Claims:
    return Claims(np.array(maker), np.array(echo), np.array(predicted_m), np.array(chance), np.zeros(len(maker)))


def test_the_farther_of_two_makers_is_heard_only_if_the_nearer_is_silent() -> None:
    # One echo, 1.2 m away, at the range of the farther maker; the nearer, at 1.0 m, would have answered with 0.9.
    data = evidence_of([(0.0, 0.0, 0.0, 1.2)])
    found = explain(claims([0, 1], [0, 0], [1.0, 1.2], [0.9, 0.8]), np.array([ASTRAY_NATS, 5.0]), data, CONFIG)
    by_farther = TRUE_SHARE * (1 - 0.9) * 0.8 * math.exp(5)  # 11.4
    by_nothing = 1 - 0.9  # so seldom is the nearer maker silent
    assert found.share == pytest.approx([0.0, by_farther / (by_farther + by_nothing)])
    assert found.unexplained == pytest.approx([by_nothing / (by_farther + by_nothing)])
    assert found.gain == pytest.approx([math.log(by_farther + by_nothing)])


def test_the_farther_of_two_makers_leaves_the_nearer_its_echo() -> None:
    data = evidence_of([(0.0, 0.0, 0.0, 1.0)])
    found = explain(claims([0, 1], [0, 0], [1.0, 1.2], [0.9, 0.8]), np.array([5.0, ASTRAY_NATS]), data, CONFIG)
    by_nearer = TRUE_SHARE * 0.9 * math.exp(5)
    assert found.share == pytest.approx([by_nearer / (by_nearer + 1), 0.0])


def test_an_echo_that_is_seldom_of_nothing_is_worth_more_to_its_maker() -> None:
    # One of twenty such echoes is of nothing that is known: an object that explains it gains log(20) nats more.
    data = evidence_of([(0.0, 0.0, 0.0, 1.0)])
    agreed = replace(data, lone_nats=np.log([0.05]))
    assert data.gain(np.zeros(1)) == pytest.approx([MOST_GAIN_NATS])
    assert agreed.gain(np.zeros(1)) == pytest.approx([MOST_GAIN_NATS + math.log(20)])


@pytest.mark.parametrize(
    ("range_m", "chance", "anywhere"),
    [
        (2.0, 0.9, 0.1),  # from behind the maker, which was silent once in ten times
        (2.0, 0.99, 0.04),  # false echoes come from anywhere, whatever stands before
        (1.06, 0.9, 1.0),  # no farther behind than 4 sigmas and 5 cm: 62 mm
        (0.5, 0.9, 1.0),  # from before the maker
    ],
)
def test_an_echo_from_behind_a_maker_is_an_unlikely_one(range_m: float, chance: float, anywhere: float) -> None:
    data = evidence_of([(0.0, 0.0, 0.0, range_m)])
    found = explain(claims([0], [0], [1.0], [chance]), np.array([ASTRAY_NATS]), data, CONFIG)
    assert found.gain == pytest.approx([math.log(anywhere)])
    assert found.unexplained == pytest.approx([1.0])


def test_the_shares_of_an_echo_and_what_is_left_to_no_maker_sum_to_one() -> None:
    rng = np.random.default_rng(1)
    data = evidence_of([(0.0, 0.0, 0.0, float(range_m)) for range_m in rng.uniform(0.5, 3.5, 5)])
    echo = np.sort(rng.integers(0, 4, 40))  # the last echo has no claim
    many = Claims(rng.integers(0, 6, 40), echo, rng.uniform(0.3, 4, 40), rng.uniform(0.01, 0.99, 40), np.zeros(40))
    found = explain(many, rng.normal(0, 5, 40), data, CONFIG)
    assert np.bincount(echo, found.share, 5) + found.unexplained == pytest.approx(np.ones(5))
    assert found.unexplained[4] == 1.0


# A wall 2 m ahead, heard from three places, and a cylinder behind it, straight ahead.
WALL, BEHIND = Line(0.0, 2.0, -1.0, 1.0), Circle(3.2, 0.0, 0.2)
BEFORE_A_WALL = [(0.0, -0.1, 0.0, 2.0), (0.0, 0.0, 0.0, 2.0), (0.0, 0.1, 0.0, 2.0)]


def test_a_wall_hides_what_stands_behind_it() -> None:
    scene = Scene(evidence_of(BEFORE_A_WALL), CONFIG)
    assert scene.claims([BEHIND], []).echo.tolist() == [0, 1, 2]
    both = scene.claims([WALL, BEHIND], [])
    assert both.maker.tolist() == [0, 0, 0]
    assert both.echo.tolist() == [0, 1, 2]


def test_a_wall_hides_nothing_beside_itself() -> None:
    # The wall begins at y = 0.5; the ways to the cylinder cross x = 2 at 0.23 m at most, that from y = 0.6. From
    # y = 0.9 the cylinder lies 16 degrees off the axis, outside the beam.
    aside = Line(0.0, 2.0, 0.5, 1.0)
    scene = Scene(evidence_of([*BEFORE_A_WALL, (0.0, 0.6, 0.0, 2.0), (0.0, 0.9, 0.0, 2.0)]), CONFIG)
    seen = scene.claims([aside, BEHIND], [])
    assert sorted(seen.echo[seen.maker == 1].tolist()) == [0, 1, 2, 3]


def test_a_corner_is_not_hidden_by_the_walls_that_make_it() -> None:
    # Walls x = 2 and y = 1.5 meet 2.5 m from the origin; an echo from there answers that corner.
    walls = [Line(0.0, 2.0, -1.0, 1.0), Line(math.pi / 2, 1.5, -1.5, 0.0)]
    data = evidence_of([*BEFORE_A_WALL, (0.0, 0.0, math.atan2(1.5, 2.0), 2.5)])
    scene = Scene(data, CONFIG)
    linked = scene.claims(walls, [Link(0, 1)])
    explained = scene.explain(linked)
    of_corner = (linked.echo == 3) & (linked.maker == 2)
    chance = CONFIG.beam.corner_chance
    likelihood = TRUE_SHARE * chance * math.exp(MOST_GAIN_NATS)
    assert linked.predicted_m[of_corner] == pytest.approx([2.5])
    assert explained.share[of_corner] == pytest.approx([likelihood / (likelihood + 1)])
