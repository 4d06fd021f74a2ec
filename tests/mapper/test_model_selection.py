"""Which objects are there: what is added by its price, how a wall is cut to its feet, what counts as determined."""

import math
from dataclasses import replace

import numpy as np
import pytest
from mapper.small_scene import MOST_GAIN_NATS, evidence_of

from noctule_mapper.config import MapperConfig, PriceConfig, RefinementConfig
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.contour.reflectors import Circle, Line, Reflector, Spot
from noctule_mapper.readings.looks import Looks
from noctule_mapper.refinement.candidates import candidates
from noctule_mapper.refinement.model_selection import add_objects, determined, is_heard_enough, trimmed

CONFIG = MapperConfig()
FIVE = (-0.4, -0.2, 0.0, 0.2, 0.4)
# Five echoes at the very ranges of a wall gain 31.4 nats.
GAIN_NATS = 5 * MOST_GAIN_NATS


def facing(along_m: tuple[float, ...]):
    """Echoes of the wall x = 2 from places on the y axis."""
    return evidence_of([(0.0, y, 0.0, 2.0) for y in along_m])


def added(price_nats: float, explained: tuple[bool, ...] = (False,) * 5) -> list[Reflector]:
    data, none = facing(FIVE), np.zeros(5)
    prices = PriceConfig(wall_nats=price_nats, point_nats=price_nats, cylinder_nats=price_nats)
    config = MapperConfig(refinement=RefinementConfig(prices=prices))
    no_contacts = Contacts(none, none, none.astype(int), none, none)
    library = candidates(data, no_contacts, config.contacts, config.cylinders, config.refinement)
    return add_objects([], np.array(explained), library, data, config)


def test_a_wall_is_added_when_its_echoes_are_worth_its_price() -> None:
    (wall,) = added(GAIN_NATS - 0.2)
    assert isinstance(wall, Line)
    assert wall.parameters == pytest.approx([0.0, 2.0], abs=1e-4)
    assert (wall.low_m, wall.high_m) == pytest.approx((-0.4, 0.4), abs=1e-3)


def test_a_wall_that_is_worth_less_than_its_price_is_not_added() -> None:
    assert added(GAIN_NATS + 0.2) == []


def test_echoes_that_are_explained_pay_for_nothing() -> None:
    # Three echoes are left, 18.8 nats.
    assert added(GAIN_NATS - 0.2, (True, False, False, False, True)) == []
    assert len(added(3 * MOST_GAIN_NATS - 0.2, (True, False, False, False, True))) == 1


@pytest.mark.parametrize(
    ("feet_m", "kept_m"),
    [
        ((0.0, 0.2, 0.4, 0.6), (0.0, 0.6)),
        ((0.0, 0.2, 0.4, 1.7, 1.8), (0.0, 0.4)),  # a hole of more than 1.2 m (LimitConfig.longest_hole_m)
        ((0.0, 0.2, 0.4, 1.0), (0.0, 0.4)),  # a lone foot, more than 0.5 m off (LimitConfig.lone_end_m)
        ((-0.6, 0.0, 0.2, 0.4), (0.0, 0.4)),
    ],
)
def test_a_wall_is_cut_to_its_longest_run_of_feet(feet_m: tuple[float, ...], kept_m: tuple[float, float]) -> None:
    wall = trimmed(Line(0.0, 2.0), np.ones(len(feet_m), bool), [], facing(feet_m), CONFIG)
    assert isinstance(wall, Line)
    assert (wall.low_m, wall.high_m) == pytest.approx(kept_m)


def test_only_echoes_that_are_used_are_feet_and_only_walls_are_cut() -> None:
    used = np.array([True, True, True, False])
    wall = trimmed(Line(0.0, 2.0), used, [], facing((0.0, 0.2, 0.4, 0.6)), CONFIG)
    assert isinstance(wall, Line)
    assert wall.high_m == pytest.approx(0.4)
    cylinder = Circle(2.5, 0.0, 0.5)
    assert trimmed(cylinder, used, [], facing((0.0, 0.2, 0.4, 0.6)), CONFIG) is cylinder


def is_determined(one: Reflector, sigmas: tuple[float, ...], places: int = 3, fine: bool = False) -> bool:
    data = facing(FIVE)
    if fine:
        data = replace(data, echoes=replace(data.echoes, step_rad=data.echoes.half_beam_rad / 2))
    return determined(one, np.diag(np.square(sigmas)), places, data, CONFIG)


def test_a_wall_is_determined_by_its_direction_and_by_its_length_or_its_places() -> None:
    # LimitConfig: 1.5 degrees; 0.35 m, or five places.
    long, short = Line(0.0, 2.0, 0.0, 0.36), Line(0.0, 2.0, 0.0, 0.34)
    assert is_determined(long, (math.radians(1.4), 0.1))
    assert not is_determined(long, (math.radians(1.6), 0.1))
    assert not is_determined(short, (math.radians(1.4), 0.1), places=4)
    assert is_determined(short, (math.radians(1.4), 0.1), places=5)


def test_a_cylinder_is_determined_when_its_radius_is_no_corners() -> None:
    # LimitConfig: 2.5 sigmas of the radius, 5 cm of the centre; CylinderConfig: radii from 2 cm to 1 m.
    assert is_determined(Circle(2.0, 0.0, 0.1), (0.01, 0.01, 0.039))
    assert not is_determined(Circle(2.0, 0.0, 0.1), (0.01, 0.01, 0.041))
    assert not is_determined(Circle(2.0, 0.0, 0.2), (0.051, 0.01, 0.01))
    assert not is_determined(Circle(2.0, 0.0, 1.1), (0.01, 0.01, 0.01))
    assert not is_determined(Circle(2.0, 0.0, 0.015), (0.001, 0.001, 0.001))


def test_a_cylinder_of_fine_sweeps_is_determined_when_its_radius_is_known_to_a_quarter() -> None:
    # LimitConfig.most_radius_sigma_share. By tape measure where it stands is known no better than the units.
    assert is_determined(Circle(2.0, 0.0, 0.4), (0.09, 0.02, 0.099), fine=True)
    assert not is_determined(Circle(2.0, 0.0, 0.4), (0.01, 0.01, 0.101), fine=True)
    assert not is_determined(Circle(2.0, 0.0, 0.1), (0.01, 0.01, 0.026), fine=True)


def test_a_cylinder_is_heard_enough_from_three_places_or_from_its_two_sides() -> None:
    """The cylinder of 0.2 m about (2, 0), by echoes of plateaus at its front, its back and beside it."""
    cylinder = Circle(2.0, 0.0, 0.2)
    front, back, beside, oblique = (
        (0, 0, 0, 1.8),
        (4, 0, np.pi, 1.8),
        (2, 2, -np.pi / 2, 1.8),
        (0.6, 1.4, -np.pi / 4, 1.78),
    )

    def is_enough(*heard: tuple[float, float, float, float]) -> bool:
        data = evidence_of(heard)
        looks = Looks(data.echoes, np.ones(len(data.echoes)))
        fine = replace(data.echoes, step_rad=data.echoes.half_beam_rad / 2)
        return is_heard_enough(cylinder, replace(data, echoes=fine, looks=looks), CONFIG)

    assert is_enough(front, back)
    assert not is_enough(front, beside)  # an edge's two walls would answer so
    assert is_enough(front, oblique, beside)
    assert not is_enough(front)


def test_a_point_is_determined_by_its_place() -> None:
    assert is_determined(Spot(2.0, 0.0), (0.049, 0.01))
    assert not is_determined(Spot(2.0, 0.0), (0.051, 0.01))
