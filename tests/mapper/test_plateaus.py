"""Plateaus: one echo of several bearings, with the direction of what made it."""

import numpy as np
import pytest
from mapper.fixed_units import BEARINGS_RAD, FIXED, survey_fixed
from mapper.room import BEARINGS_RAD as COARSE_RAD
from mapper.room import LabelledSweep, Physics, Room, survey_labelled
from mapper.small_scene import evidence_of

from noctule_mapper.config import RefinementConfig
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import echoes_of, join
from noctule_mapper.readings.evidence import Evidence, evidence
from noctule_mapper.readings.looks import looks_of
from noctule_mapper.readings.plateaus import Plateaus, distinct, of_fine_sweeps, plateaus
from noctule_mapper.readings.sweep import step_rad

CONFIG = RefinementConfig()
# Wide enough for feet and corners to lie far apart: each is a plateau of its own.
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
CLEAN = Physics(sigma_m=0.0032, lobe=FIXED.lobe)


def heard(surveyed: list[LabelledSweep]) -> Evidence:
    echoes = join([echoes_of(one.sweep, number, 0.0032) for number, one in enumerate(surveyed)])
    return evidence(echoes, echoes.sigma_m, 4.0, CONFIG, looks_of([one.sweep for one in surveyed], 0.0032))


def from_the_middle(heading_rad: float, physics: Physics, seed: int = 1) -> Evidence:
    pose = np.array([(1.6, 1.1, heading_rad)])
    return plateaus(heard(survey_fixed(ROOM, pose, np.random.default_rng(seed), physics)), CONFIG)


# The feet of the perpendiculars from (1.6, 1.1): direction and range of each wall.
FEET = {"south": (-np.pi / 2, 1.1), "north": (np.pi / 2, 1.9), "west": (np.pi, 1.6), "east": (0.0, 2.4)}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("physics", [CLEAN, FIXED], ids=["clean", "false, lost and late echoes"])
def test_a_plateau_has_the_direction_and_the_range_of_its_wall(physics: Physics, seed: int) -> None:
    found = from_the_middle(np.pi / 2, physics, seed)  # all but straight down lies inside the sweep
    for name in ("north", "west", "east"):
        direction_rad, range_m = FEET[name]
        # Within a late cycle of 4.3 mm and the median's noise: a false echo's plateau lies elsewhere.
        level = np.nonzero(np.abs(found.echoes.range_m - range_m) < 0.006)[0]
        off_rad = np.abs(wrapped(found.echoes.axis_rad[level] - direction_rad))
        nearest = level[off_rad.argmin()]
        assert off_rad.min() < 3 * found.direction_sigma_rad[nearest]
        assert found.direction_sigma_rad[nearest] < np.radians(2)  # of steps of 4.5 degrees


def test_the_end_of_a_sweep_cuts_a_plateau_and_its_direction_is_less_sure() -> None:
    # The sweep's last bearing, at 135 degrees, is 4 degrees short of straight up: half of the plateau is missing.
    cut = from_the_middle(np.pi / 2 - np.radians(131), CLEAN)
    whole = from_the_middle(0.0, CLEAN)
    (direction_rad, range_m), sure = FEET["north"], []
    for found in (cut, whole):
        level = np.nonzero(np.abs(found.echoes.range_m - range_m) < 0.01)[0]
        nearest = level[np.abs(wrapped(found.echoes.axis_rad[level] - direction_rad)).argmin()]
        assert abs(wrapped(found.echoes.axis_rad[nearest] - direction_rad)) <= found.echoes.half_beam_rad[nearest]
        sure.append(found.direction_sigma_rad[nearest])
    assert sure[0] > 1.5 * sure[1]


def test_coarse_sweeps_have_no_plateaus() -> None:
    surveyed = survey_labelled(ROOM, np.array([(1.6, 1.1, 0.0)]), np.random.default_rng(1), CLEAN)
    assert len(surveyed[0].sweep.bearing_rad) == len(COARSE_RAD)
    assert not of_fine_sweeps(heard(surveyed)).any()
    assert looks_of([surveyed[0].sweep], 0.0032) is None


def test_every_reading_that_listened_is_a_look_and_sweeps_of_one_place_share_theirs() -> None:
    surveyed = survey_fixed(ROOM, np.array([(1.6, 1.1, 0.0)]), np.random.default_rng(1), CLEAN)
    looks = looks_of([one.sweep for one in surveyed], 0.0032)
    assert looks is not None
    assert len(looks.weight) == 4 * len(BEARINGS_RAD)
    assert looks.weight.sum() == pytest.approx(len(BEARINGS_RAD))
    silent = np.concatenate([np.isnan(one.sweep.range_m) for one in surveyed])
    assert np.array_equal(looks.echoes.range_m > 4.0, silent)


@pytest.mark.parametrize(
    ("second", "kept"),
    [
        ((0.0, 0.0, 5.0, 2.0043), [0]),  # a cycle late (25 us, 4.3 mm), overlapping: one reflector
        ((0.0, 0.0, 5.0, 2.02), [0, 1]),  # 2 cm farther away: a wall and its corner 28 cm aside, d^2 / (2 R)
        ((0.0, 0.0, 25.0, 2.0043), [0, 1]),  # 20 degrees wide each, so they do not overlap
        ((0.5, 0.0, 5.0, 2.0043), [0, 1]),  # from another place
    ],
)
def test_of_plateaus_that_are_of_one_reflector_the_one_of_most_readings_stands(
    second: tuple[float, float, float, float], kept: list[int]
) -> None:
    x_m, y_m, direction_deg, range_m = second
    data = evidence_of([(0.0, 0.0, 0.0, 2.0), (x_m, y_m, np.radians(direction_deg), range_m)])
    for readings, expected in ((np.array([9, 4]), kept), (np.array([4, 9]), [1] if kept == [0] else kept)):
        left = distinct(Plateaus(data, readings, np.full(2, np.radians(20))), CONFIG)
        assert left.readings.tolist() == readings[expected].tolist()
        assert left.evidence.echoes.range_m.tolist() == data.echoes.range_m[expected].tolist()


@pytest.mark.parametrize(
    ("bearings_rad", "expected_rad"),
    [
        ([0.3], 2 * np.pi),
        ([0.3, 0.3], 2 * np.pi),  # the same bearing twice is no step
        ([0.0, 0.1, 0.2], 0.1),
        ([0.2, 0.0, 0.1, 0.1], 0.1),
        ([0.0, 1e-300], 1e-3),
    ],
)
def test_the_step_of_a_sweep_is_that_between_bearings_that_differ(
    bearings_rad: list[float], expected_rad: float
) -> None:
    assert step_rad(np.array(bearings_rad)) == pytest.approx(expected_rad)
