"""From the message to readings: corrections, defaults, and what is refused."""

import json

import numpy as np
import pytest
from google.protobuf.json_format import Parse

from noctule.messages_pb2 import Sweep
from noctule_mapper.config import SensorConfig
from noctule_mapper.readings.sweep import SweepError, from_message, identity_of, speed_of_sound_m_s

SHORTEST = {
    "site": "s",
    "unit": "u",
    "boot": 1,
    "sequence": 0,
    "start": "2026-01-01T00:00:00Z",
    "pose": {"x_m": 0, "y_m": 0, "heading_rad": 0},
    "air_temperature_c": 20,
    "readings": [
        {"bearing_rad": -2.356, "time_offset_s": 0.0, "time_of_flight_s": 0.0058},
        {"bearing_rad": -1.963, "time_offset_s": 0.3},
    ],
}


def sweep(**changes) -> Sweep:
    return Parse(json.dumps({**SHORTEST, **changes}), Sweep())


def test_the_shortest_line_of_a_survey_is_a_sweep_of_the_papers_sensor():
    readings = from_message(sweep())
    # 331.3 + 0.606 * 20 = 343.42 m/s there and back, less the paper's mean of 0.23 cm (Section V.A).
    assert readings.range_m[0] == pytest.approx(343.42 * 0.0058 / 2 - 0.0023)
    assert np.isnan(readings.range_m[1]) and list(readings.no_echo) == [False, True]
    assert np.degrees(readings.beam_width_rad) == pytest.approx(22.5)
    assert readings.range_sigma_m is None


def test_sweeps_without_a_log_are_told_apart_by_unit_boot_and_sequence():
    lines = [sweep(), sweep(sequence=1), sweep(boot=2), sweep(unit="v")]
    assert len({identity_of(line) for line in lines}) == 4
    assert identity_of(sweep(log_id="a", log_sequence=7)) == ("a", 7)


def test_what_a_sweep_says_of_its_sensor_goes_before_the_default():
    default = SensorConfig(range_bias_m=0.01, range_sigma_m=0.02)
    own = from_message(sweep(sensor={"range_bias_m": 0.0, "range_sigma_m": 0.001}), default)
    assert (own.range_sigma_m, from_message(sweep(), default).range_sigma_m) == (0.001, 0.02)
    assert own.range_m[0] - from_message(sweep(), default).range_m[0] == pytest.approx(0.01)


def test_warmer_air_makes_ranges_longer():
    # 10 K is 1.8 % of the speed of sound.
    assert speed_of_sound_m_s(30) / speed_of_sound_m_s(20) == pytest.approx(1.018, abs=5e-4)
    warm = from_message(sweep(air_temperature_c=30), SensorConfig(range_bias_m=0.0, air_temperature_c=20))
    assert warm.range_m[0] == pytest.approx((331.3 + 0.606 * 30) * 0.0058 / 2)


def test_a_range_that_the_sensor_can_not_have_is_no_echo_of_a_reflector():
    # HC-SR04: 2 cm to 4 m.
    readings = [{"bearing_rad": 0, "time_of_flight_s": seconds} for seconds in (0.00005, 0.01, 0.036)]
    assert list(np.isfinite(from_message(sweep(readings=readings)).range_m)) == [False, True, False]


def test_a_reading_that_was_no_echo_has_no_range_whatever_its_time_of_flight():
    readings = [
        {"bearing_rad": 0, "time_of_flight_s": 0.01, "status": status}
        for status in ("READING_STATUS_STUCK_HIGH", "READING_STATUS_ECHO")
    ]
    assert list(np.isfinite(from_message(sweep(readings=readings)).range_m)) == [False, True]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"pose": None}, "no pose"),
        ({"pose": {"x_m": "NaN"}}, "x_m is nan"),
        ({"readings": [{"bearing_rad": "Infinity"}]}, "bearing_rad is inf"),
        ({"readings": [{"bearing_rad": 0, "time_of_flight_s": "NaN"}]}, "time_of_flight_s"),
        ({"pose": {"sigma_position_m": -1}}, "sigma_position_m is -1"),
        ({"pose": {"x_m": 10_001}}, "from the site's origin"),
        ({"sensor": {"range_sigma_m": 0}}, "range_sigma_m"),
        ({"sensor": {"range_sigma_m": "NaN"}}, "range_sigma_m is nan"),
        ({"sensor": {"range_sigma_m": "Infinity"}}, "range_sigma_m is inf"),
        ({"sensor": {"range_bias_m": "NaN"}}, "range_bias_m is nan"),
        ({"sensor": {"range_bias_m": "-Infinity"}}, "range_bias_m is -inf"),
        ({"sensor": {"beam_width_rad": 3.15}}, "beam_width_rad is 3.15"),
        ({"sensor": {"beam_width_rad": 0}}, "beam_width_rad is 0"),
        ({"sensor": {"beam_width_rad": "NaN"}}, "beam_width_rad is nan"),
        ({"air_temperature_c": "NaN"}, "air_temperature_c is nan"),
        ({"air_temperature_c": "Infinity"}, "air_temperature_c is inf"),
        ({"air_temperature_c": -101}, "air_temperature_c is -101"),
    ],
)
def test_a_sweep_that_can_not_be_mapped_is_refused_by_name(changes, complaint):
    with pytest.raises(SweepError, match=complaint) as refused:
        from_message(sweep(**changes))
    assert "unit 'u'" in str(refused.value)


@pytest.mark.parametrize(
    ("sensor", "default", "told"),
    [
        # Stated by the unit: exact unless an error is stated beside it.
        ({"face_offset_m": 0.015}, {}, (0.015, 0.0)),
        ({"face_offset_m": 0.015, "face_offset_sigma_m": 0.002}, {"face_offset_m": 0.03}, (0.015, 0.002)),
        # Stated for all.
        ({"range_bias_m": 0.001}, {"face_offset_m": 0.03, "face_offset_sigma_m": 0.004}, (0.03, 0.004)),
        # A mean error that was measured from the axis has the offset in it.
        ({"range_bias_m": -0.018}, {}, (0.0, 0.0)),
        ({}, {"range_bias_m": -0.018}, (0.0, 0.0)),
        # Nothing stated: 1 to 3 cm, which side of the pose's point nobody knows.
        ({}, {}, (0.0, 0.02)),
    ],
)
def test_what_is_known_of_the_face_s_offset(sensor, default, told):
    read = from_message(sweep(sensor=sensor), SensorConfig(**default))
    assert (read.face_offset_m, read.face_offset_sigma_m) == told


def test_a_range_counts_from_the_axis_and_a_mean_error_from_the_face():
    stated = {"range_bias_m": 0.002, "face_offset_m": 0.015}
    without = from_message(sweep(sensor={"range_bias_m": 0.0}))
    assert from_message(sweep(sensor=stated)).range_m == pytest.approx(without.range_m + 0.013, nan_ok=True)
