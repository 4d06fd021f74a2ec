"""Cylinders that two units hear from one side: the directions of two plateaus cross where their ranges agree."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from mapper.judged_poses import taped
from mapper.small_scene import Heard, evidence_of

from noctule_mapper.config import MapperConfig
from noctule_mapper.contour.likelihood import is_told_by_two, price_beside
from noctule_mapper.contour.reflectors import Circle
from noctule_mapper.readings.evidence import Evidence
from noctule_mapper.readings.looks import Looks
from noctule_mapper.refinement.one_sided import one_sided_cylinders

CONFIG = MapperConfig()
# The cylinder of 0.2 m about (1, 1), from (0, 0) and from (2, 0): root 2 less 0.2 away, 45 degrees to either side.
WEST: Heard = (0.0, 0.0, math.radians(45), math.sqrt(2) - 0.2)
EAST: Heard = (2.0, 0.0, math.radians(135), math.sqrt(2) - 0.2)
SOUTH: Heard = (1.0, 0.0, math.radians(90), 0.8)


def plateaus_of(heard: Sequence[Heard], sigma_rad: float = math.radians(1)) -> Evidence:
    data = evidence_of(heard)
    fine = replace(data.echoes, step_rad=data.echoes.half_beam_rad / 2)
    looks = Looks(fine, np.ones(len(fine)))
    return replace(data, echoes=fine, direction_sigma_rad=np.full(len(fine), sigma_rad), looks=looks)


def found(*heard: Heard, sigma_rad: float = math.radians(1)) -> list[Circle]:
    data = plateaus_of(heard, sigma_rad)
    return list(one_sided_cylinders(np.ones(len(heard), bool), data, CONFIG))


def test_two_plateaus_tell_the_cylinder_about_which_they_agree() -> None:
    (circle,) = found(WEST, EAST)
    assert circle.parameters == pytest.approx([1.0, 1.0, 0.2], abs=1e-3)


def test_directions_a_little_off_are_fitted_together_with_the_ranges() -> None:
    x_m, y_m, axis_rad, range_m = EAST
    (circle,) = found(WEST, (x_m, y_m, axis_rad + math.radians(1), range_m + 0.003))
    # One degree at 1.4 m is 2.5 cm.
    assert circle.parameters == pytest.approx([1.0, 1.0, 0.2], abs=0.025)


@pytest.mark.parametrize(
    "heard",
    [
        [WEST, (*EAST[:3], EAST[3] - 0.5)],  # of two walls: the ranges leave radii of 0.2 and 0.7 m
        [WEST, (2.0, 0.0, math.radians(-45), 1.2)],  # the other way: directions that do not cross
        [WEST, (0.5, 0.5, math.radians(45), math.sqrt(0.5) - 0.2)],  # one behind the other: nothing tells a radius
        [WEST, WEST],  # one place
    ],
)
def test_two_plateaus_that_do_not_agree_are_no_cylinder(heard: list[Heard]) -> None:
    assert not found(*heard)


def test_a_cylinder_whose_radius_two_plateaus_leave_open_is_none() -> None:
    # Eight degrees at 1.4 m are 20 cm across, as much as the radius.
    assert not found(WEST, EAST, sigma_rad=math.radians(8))


def test_plateaus_that_something_explains_are_of_no_cylinder() -> None:
    data = plateaus_of([WEST, EAST])
    assert not list(one_sided_cylinders(np.array([True, False]), data, CONFIG))


@pytest.mark.parametrize(
    ("heard", "costs_as_a_wall"),
    [
        ([WEST, SOUTH], True),  # 45 degrees apart
        ([WEST, EAST], False),  # at a right angle, as the two walls of most corners answer
        ([WEST, EAST, SOUTH], False),  # arcs of three may be of anything
    ],
)
def test_a_cylinder_that_two_plateaus_tell_costs_what_a_wall_does(heard: list[Heard], costs_as_a_wall: bool) -> None:
    prices = CONFIG.refinement.prices
    wanted = prices.wall_nats if costs_as_a_wall else prices.cylinder_nats
    assert price_beside(Circle(1.0, 1.0, 0.2), plateaus_of(heard), CONFIG.refinement) == wanted


def test_echoes_whose_directions_only_beams_tell_are_no_plateaus() -> None:
    cylinder = Circle(1.0, 1.0, 0.2)
    assert is_told_by_two(cylinder, plateaus_of([WEST, SOUTH]))
    assert not is_told_by_two(cylinder, evidence_of([WEST, SOUTH]))


@pytest.mark.parametrize("seed", [20016, 20052])
def test_a_cylinder_that_two_units_hear_from_one_side_is_found_by_tape_measure(seed: int) -> None:
    verdict = taped(seed).verdict
    assert "cylinder 0" in verdict.due
    assert not any(what.startswith("cylinder") for what in verdict.missed)
    assert not verdict.false


def test_two_walls_at_a_right_angle_are_no_cylinder_by_tape_measure() -> None:
    assert not taped(20024).verdict.false
