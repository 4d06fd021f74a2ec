"""Sensors that repeat themselves are found by what no room can answer; rooms are never taken for one."""

import math

import numpy as np
import pytest
from mapper.fixed_units import fixed_room, survey_fixed
from mapper.room import HARD, PLAIN, Room, message_of, paper_path, paper_room, random_room, survey_labelled

from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO, Sweep
from noctule_mapper.readings.sweep import StuckSensorError, from_message, speed_of_sound_m_s

COARSE_RAD = np.radians(np.arange(-135, 136, 22.5))  # the paper's plan, Section VI
FINE_RAD = np.radians(np.linspace(-135, 135, 61))
ONE_ROUND_RAD = np.radians(9.8 * np.arange(37) - 180)


def sweep_of(bearings_rad: np.ndarray, ranges_m: np.ndarray) -> Sweep:
    """A sweep with these ranges at 20 degrees C, NaN for no echo."""
    made = Sweep(unit="u7", log_id="log", log_sequence=1, air_temperature_c=20.0)
    made.pose.x_m = 1.0
    made.sensor.range_bias_m = 0.0
    for bearing_rad, range_m in zip(bearings_rad, ranges_m, strict=True):
        if math.isnan(range_m):
            made.readings.add(bearing_rad=bearing_rad, status=READING_STATUS_NO_ECHO)
        else:
            flight_s = 2 * range_m / speed_of_sound_m_s(20.0)
            made.readings.add(bearing_rad=bearing_rad, status=READING_STATUS_ECHO, time_of_flight_s=flight_s)
    return made


@pytest.mark.parametrize("bearings_rad", [COARSE_RAD, FINE_RAD, ONE_ROUND_RAD], ids=["13", "61", "37"])
@pytest.mark.parametrize("values_m", [(0.45,), (0.0,), (6.5,), (0.45, 1.2), (0.02, 4.0)], ids=str)
@pytest.mark.parametrize("seed", range(3))
def test_a_sensor_that_repeats_one_value_or_a_few_is_found(
    bearings_rad: np.ndarray, values_m: tuple[float, ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    ranges_m = np.resize(np.array(values_m), len(bearings_rad))
    if seed:  # the sensor's noise, 3.2 mm (Liu et al. 2019, Section V.A), and a few readings lost
        ranges_m = np.maximum(ranges_m + rng.normal(0, 0.0032, len(ranges_m)), 0.0)
        ranges_m[rng.choice(len(ranges_m), 1)] = math.nan
    with pytest.raises(StuckSensorError, match=r"sweep 1 of 'log' \(unit 'u7'\): its sensor repeats "):
        from_message(sweep_of(bearings_rad, ranges_m))


def test_a_silent_sweep_and_a_narrow_one_are_not_stuck() -> None:
    assert from_message(sweep_of(FINE_RAD, np.full(61, math.nan))).no_echo.all()
    # 45 degrees of bearings on one post 0.2 m away, where the lobe is 40 degrees wide.
    assert len(from_message(sweep_of(np.radians(np.arange(-22.5, 23, 4.5)), np.full(11, 0.2))).range_m) == 11


def test_a_unit_in_the_very_middle_of_a_closet_is_not_stuck() -> None:
    half_m = 0.45
    closet = Room(np.array([(-half_m, -half_m), (half_m, -half_m), (half_m, half_m), (-half_m, half_m)]))
    rng = np.random.default_rng(1)
    for bearings_rad in (COARSE_RAD, FINE_RAD, ONE_ROUND_RAD):
        for one in survey_labelled(closet, np.zeros((1, 3)), rng, PLAIN, True, bearings_rad):
            assert np.isfinite(from_message(message_of(one.sweep, 20.0)).range_m).sum() >= 4


@pytest.mark.parametrize("seed", range(0, 40, 20))
def test_no_sweep_of_a_room_is_taken_for_a_stuck_sensors(seed: int) -> None:
    for number in range(seed, seed + 20):
        rng = np.random.default_rng(number)
        room, path = random_room(rng)
        surveyed = survey_labelled(room, path, rng, HARD)
        surveyed += survey_fixed(*fixed_room(rng), rng)
        for one in surveyed:
            from_message(message_of(one.sweep, 20.0))


def test_the_papers_room_is_not_stuck_and_repeats_within_it_are() -> None:
    rng = np.random.default_rng(4)
    messages = [message_of(one.sweep, 20.0) for one in survey_labelled(paper_room(), paper_path(), rng)]
    stuck = set(rng.choice(len(messages), 5, replace=False).tolist())
    for number in stuck:
        for reading in messages[number].readings:
            reading.status, reading.time_of_flight_s = READING_STATUS_ECHO, 0.00263
    found = set()
    for number, message in enumerate(messages):
        try:
            from_message(message)
        except StuckSensorError:
            found.add(number)
    assert found == stuck
