"""Surveys too small or too poor for a wall: a map with nothing on it is a map, by every method and every rule."""

import math
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from google.protobuf import json_format
from hypothesis import given, settings
from hypothesis import strategies as st
from mapper.command import noctule_mapper

from noctule import bounds, survey
from noctule.messages_pb2 import READING_STATUS_NO_ECHO, Contour, Sweep
from noctule_mapper.choices import Method, Rule
from noctule_mapper.config import MapperConfig, SensorConfig
from noctule_mapper.readings.sweep import speed_of_sound_m_s
from noctule_mapper.survey_fit import fit

pytestmark = pytest.mark.filterwarnings("error")  # a division by nought on the way is a fault too

AIR_C = 20.0
NO_BIAS = SensorConfig(range_bias_m=0.0)
METHODS, RULES = get_args(Method), get_args(Rule)
Echo = tuple[float, float | None]  # bearing_rad, range_m


def sweep(number: int, place_m: tuple[float, float], echoes: list[Echo], sigma_m: float | None = None) -> Sweep:
    """A sweep from ``place_m`` whose sensor is calibrated to ``sigma_m``, or not at all."""
    made = Sweep(site="s", unit="u", log_id="log", log_sequence=number, air_temperature_c=AIR_C)
    made.start.seconds = 1_767_225_600 + number
    made.pose.x_m, made.pose.y_m = place_m
    if sigma_m is not None:
        made.sensor.range_sigma_m = sigma_m
    for bearing_rad, range_m in echoes:
        if range_m is None:
            made.readings.add(bearing_rad=bearing_rad, status=READING_STATUS_NO_ECHO)
        else:
            made.readings.add(bearing_rad=bearing_rad, time_of_flight_s=2 * range_m / speed_of_sound_m_s(AIR_C))
    return made


def along_a_wall(places: int, step_m: float) -> list[Sweep]:
    """Exact ranges of a wall 1 m away from places on a line along it: their spread is estimated as nought."""
    return [
        sweep(number, (number * step_m, 0.0), [(math.pi / 2 + turn, 1.0) for turn in (-0.1, 0.0, 0.1)])
        for number in range(places)
    ]


def assert_is_a_map(contour: Contour, sweeps: list[Sweep]) -> None:
    """Finite numbers, from the sweeps of the last visit to each place, and what outlines and files can be made of."""
    assert min(len(sweeps), 1) <= contour.sweeps <= len({one.log_sequence for one in sweeps})
    bounds.check(contour)


ranges_m = st.none() | st.sampled_from([0.5, 1.0, 1.0, 2.0]) | st.floats(0.02, 4.0)
readings = st.lists(st.tuples(st.sampled_from([-0.4, -0.2, 0.0, 0.0, 0.2, 0.4, 3.0]), ranges_m), max_size=3)
places = st.sampled_from([(0.0, 0.0), (0.0, 0.0), (0.2, 0.0), (0.4, 0.0), (0.3, 0.3), (5.0, 5.0)])
small = st.lists(st.tuples(places, readings, st.sampled_from([None, None, 0.001, 0.0032])), max_size=3)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=60)
@given(rows=small)
def test_any_few_echoes_make_a_map(method: Method, rows: list) -> None:
    sweeps = [sweep(number, *row) for number, row in enumerate(rows)]
    assert_is_a_map(fit(sweeps, MapperConfig(method=method), NO_BIAS), sweeps)


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=15)
@given(count=st.integers(1, 12), step_m=st.sampled_from([0.05, 0.1, 0.2]), rounds=st.integers(1, 2))
def test_ranges_that_are_all_equal_make_a_map(method: Method, count: int, step_m: float, rounds: int) -> None:
    sweeps = along_a_wall(count, step_m) * rounds
    for number, one in enumerate(sweeps):
        one.log_sequence = number
    assert_is_a_map(fit(sweeps, MapperConfig(method=method), NO_BIAS), sweeps)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("rule", RULES)
def test_one_place_is_a_map_with_nothing_on_it(method: Method, rule: Rule) -> None:
    # A scan in whole centimetres all round one place: no two places agree on anything.
    ranges_m = np.round(1.0 / np.maximum(np.abs(np.cos(np.linspace(0, math.tau, 37))), 0.4), 2)
    turns = np.linspace(-math.pi, math.pi, 37)
    scan = sweep(1, (0.0, 0.0), [(float(a), float(r)) for a, r in zip(turns, ranges_m, strict=True)])
    contour = fit([scan], MapperConfig(method=method, rule=rule))
    assert_is_a_map(contour, [scan])
    assert not (contour.walls or contour.corners or contour.cylinders)


def test_the_spread_of_a_sensor_does_not_shrink_to_nought_with_exact_ranges() -> None:
    contour = fit(along_a_wall(12, 0.1), None, NO_BIAS)
    (wall,) = contour.walls
    assert wall.rho_m == pytest.approx(1.0, abs=0.005)
    assert wall.covariance[3] > 0


@pytest.mark.parametrize("out", ["map.geojson", "map.dxf", "map.yaml"])
def test_a_map_with_nothing_on_it_is_printed_and_exported(tmp_path: Path, out: str) -> None:
    source, contour = tmp_path / "survey.jsonl", tmp_path / "contour.json"
    with source.open("w") as stream:
        survey.write([sweep(1, (0.0, 0.0), [(0.0, 1.0)])], stream)
    fitted = noctule_mapper("fit", source, "--contour", contour)
    assert (fitted.exit_code, fitted.complaint) == (0, "")
    assert [line.split()[0] for line in fitted.output.split("\n") if line] == ["wall", "corner", "cylinder", "echoes"]
    assert json_format.Parse(contour.read_text(), Contour()).sweeps == 1
    for given_ in (source, contour):
        exported = noctule_mapper("export", given_, tmp_path / out)
        assert exported.exit_code == 0, exported.complaint
        assert "walls 0, corners 0, cylinders 0" in exported.output
