"""Turning: the two senses of a unit differ by its gears' play, and its own plateaus tell by how much."""

from dataclasses import replace

import numpy as np
import pytest
from mapper.fixed_units import FIXED, found_alone, survey_fixed, survey_to_and_fro
from mapper.room import LabelledSweep, Room

from noctule_mapper.config import RefinementConfig
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.echoes import echoes_of, join
from noctule_mapper.readings.evidence import Evidence, evidence
from noctule_mapper.readings.looks import looks_of
from noctule_mapper.readings.plateaus import plateaus_as_heard
from noctule_mapper.readings.turning import offset_of, reconciled

CONFIG = RefinementConfig()
ROOM = Room(np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)]))
POSE = np.array([(1.6, 1.1, np.pi / 2)])


def heard(surveyed: list[LabelledSweep]) -> Evidence:
    echoes = join([echoes_of(one.sweep, number, 0.0032) for number, one in enumerate(surveyed)])
    looks = looks_of([one.sweep for one in surveyed], 0.0032)
    return replace(evidence(echoes, echoes.sigma_m, 4.0, CONFIG), looks=looks)


def test_the_order_of_the_bearings_tells_the_sense() -> None:
    surveyed = survey_to_and_fro(ROOM, POSE, np.random.default_rng(1), 0.0)
    senses = [set(echoes_of(one.sweep, 0, 0.0032).sense.tolist()) for one in surveyed]
    assert senses == [{1}, {-1}, {1}, {-1}]


def test_bearings_in_no_order_have_no_sense() -> None:
    sweep = survey_fixed(ROOM, POSE, np.random.default_rng(1))[0].sweep
    order = np.random.default_rng(2).permutation(len(sweep.bearing_rad))
    mixed = replace(
        sweep, bearing_rad=sweep.bearing_rad[order], range_m=sweep.range_m[order], no_echo=sweep.no_echo[order]
    )
    assert set(echoes_of(mixed, 0, 0.0032).sense.tolist()) == {0}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("play_deg", [0.0, 1.0, 2.0, 3.0])
def test_the_play_of_the_gears_is_estimated_within_its_error(play_deg: float, seed: int) -> None:
    surveyed = survey_to_and_fro(ROOM, POSE, np.random.default_rng(seed), np.radians(play_deg))
    found = offset_of(heard(surveyed), CONFIG)
    assert np.degrees(found.sigma_rad) < 1.2  # several plateaus of 1.3 degrees in either sense
    assert abs(found.offset_rad - np.radians(play_deg)) < 3 * found.sigma_rad


def test_half_of_the_offset_goes_to_each_sense_and_to_the_looks() -> None:
    data = heard(survey_to_and_fro(ROOM, POSE, np.random.default_rng(1), np.radians(3)))
    offset_rad, after = offset_of(data, CONFIG).offset_rad, reconciled(data, CONFIG)
    assert data.looks is not None
    assert after.looks is not None
    for before, corrected in ((data.echoes, after.echoes), (data.looks.echoes, after.looks.echoes)):
        assert before.axis_rad - corrected.axis_rad == pytest.approx(before.sense * offset_rad / 2)


def test_reconciled_senses_hear_one_lobe_as_wide_as_it_is() -> None:
    feet_m = (1.6, 1.9, 2.4)
    lobe_deg = float(np.mean(2 * FIXED.half_width_deg(feet_m)))
    data = heard(survey_to_and_fro(ROOM, POSE, np.random.default_rng(3), np.radians(3)))
    widths_deg = []
    for senses in (data, reconciled(data, CONFIG)):
        flat = plateaus_as_heard(senses, CONFIG)
        widest = [flat.width_rad[np.abs(flat.evidence.echoes.range_m - foot_m) < 0.01].max() for foot_m in feet_m]
        widths_deg.append(float(np.degrees(np.mean(widest))))
    apart, together = widths_deg
    assert apart - lobe_deg > 3  # the play itself
    assert together == pytest.approx(lobe_deg, abs=1.5)  # a third of a step


def test_one_sense_alone_is_left_as_it_is() -> None:
    data = heard(survey_fixed(ROOM, POSE, np.random.default_rng(1)))
    assert np.array_equal(reconciled(data, CONFIG).echoes.axis_rad, data.echoes.axis_rad)


@pytest.mark.parametrize("play_deg", [1.0, 3.0])
def test_a_unit_with_play_knows_its_walls_all_the_same(play_deg: float) -> None:
    mapper = Mapper()
    for one in survey_to_and_fro(ROOM, POSE, np.random.default_rng(5), np.radians(play_deg), FIXED):
        mapper.register_sweep(one.sweep)
    assert found_alone(mapper.contour(), ROOM, POSE[0]) == [1, 2, 3]
