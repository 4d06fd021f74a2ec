"""From the wire's integers to SI units and back: expected figures are firmware/README.md's definitions."""

from dataclasses import replace
from math import pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from noctule import bounds
from noctule import messages_pb2 as messages
from noctule.site import FixedPose, Pose2, Sensor, Site, Unit
from noctule_gateway.clock.boot_clocks import SweepTime
from noctule_gateway.clock.regression import HostTime
from noctule_gateway.wire.frames import NO_TEMPERATURE, NO_WAYPOINT, NoEcho, Reading, Sweep
from noctule_gateway.wire.sweep_message import to_message

UNIT = Unit("u1", 7, "socket://h:1", FixedPose(Pose2(0, 0, 0)), Sensor(), None, False, 0.0)
SITE = Site("s", (UNIT,), None, "utc")
SWEEP = Sweep(1, 2, 7, 5, 3, NO_WAYPOINT, NO_TEMPERATURE, 0, ())
START = HostTime(1_800_000_000.25, 0.001)


READINGS = st.builds(Reading, st.integers(-32768, 32767), st.integers(0, 0xFFFFFF), st.integers(0, 0xFFFFFF))
SWEEPS = st.builds(
    Sweep,
    st.integers(0, 0xFFFF),
    st.integers(0, 0xFFFFFFFF),
    st.integers(0, 0xFFFFFFFF),
    st.integers(0, 0xFFFFFFFF),
    st.integers(0, 2**48 - 1),
    st.integers(0, 0xFFFF),
    st.integers(-32768, 32767),
    st.integers(0, 1),
    st.lists(READINGS, max_size=64).map(tuple),
)


def message(sweep: Sweep, site: Site = SITE, drift: float | None = None) -> messages.Sweep:
    return to_message(sweep, site, UNIT, SweepTime(START, drift, 1 + (drift or 0.0)), None)


@pytest.mark.parametrize(
    ("wire", "bearing_rad"),
    [(0, 0.0), (16384, pi / 2), (-24576, -0.75 * pi), (32767, pi - 2 * pi / 65536), (-32768, pi)],
)
def test_a_bearing_is_a_65536th_of_a_turn_and_ends_in_minus_pi_to_pi(wire: int, bearing_rad: float) -> None:
    (reading,) = message(replace(SWEEP, readings=(Reading(wire, 0, 0),))).readings
    assert reading.bearing_rad == pytest.approx(bearing_rad)
    assert -pi < reading.bearing_rad <= pi


@pytest.mark.parametrize(
    ("echo", "status"),
    [
        (NoEcho.NO_ECHO, messages.READING_STATUS_NO_ECHO),
        (NoEcho.TOO_EARLY, messages.READING_STATUS_TOO_EARLY),
        (NoEcho.STUCK_HIGH, messages.READING_STATUS_STUCK_HIGH),
        (NoEcho.NO_SENSOR, messages.READING_STATUS_NO_SENSOR),
        (0xFFFFF0, messages.READING_STATUS_NO_ECHO),  # reserved: what kind, a later firmware knows
    ],
)
def test_each_kind_of_no_echo_has_its_status_and_no_time_of_flight(echo: int, status: int) -> None:
    (reading,) = message(replace(SWEEP, readings=(Reading(0, 0, echo),))).readings
    assert reading.status == status
    assert not reading.HasField("time_of_flight_s")


def test_the_longest_echo_and_offset_keep_their_quarter_microseconds() -> None:
    (reading,) = message(replace(SWEEP, readings=(Reading(0, 0xFFFFFF, 0xFFFFEF),))).readings
    assert reading.time_of_flight_s == pytest.approx(0xFFFFEF * 0.25e-6)
    assert reading.time_offset_s == pytest.approx(0xFFFFFF * 4e-6)


def test_what_the_site_file_says_of_the_air_takes_the_place_of_what_the_unit_has_measured() -> None:
    warm = replace(SITE, air_temperature_c=21.0)
    cold = replace(SWEEP, temperature=-512)
    assert message(cold).air_temperature_c == -5.12
    assert message(cold, warm).air_temperature_c == 21.0
    assert message(SWEEP, warm).air_temperature_c == 21.0
    assert not message(SWEEP).HasField("air_temperature_c")


@pytest.mark.parametrize("drift", [-0.01, 0.01])
def test_an_oscillator_that_is_one_percent_off_does_not_put_the_wall_there_too(drift: float) -> None:
    # A wall at 2 m with sound at 343 m/s, and a reading 0.5 s into the sweep, counted by an oscillator that is off.
    flight_s, offset_s = 4.0 / 343, 0.5
    counted = Reading(0, round(offset_s * (1 + drift) / 4e-6), round(flight_s * (1 + drift) / 0.25e-6))
    made = message(replace(SWEEP, readings=(counted,)), drift=drift)
    assert made.readings[0].time_of_flight_s == pytest.approx(flight_s, abs=0.25e-6)
    assert made.readings[0].time_offset_s == pytest.approx(offset_s, abs=4e-6)
    assert made.clock_drift == drift
    as_counted = message(replace(SWEEP, readings=(counted,)))
    assert as_counted.readings[0].time_of_flight_s == pytest.approx(flight_s * (1 + drift), abs=0.25e-6)
    assert not as_counted.HasField("clock_drift")


def test_start_keeps_its_time_to_the_microsecond_and_an_absent_pose_stays_absent() -> None:
    made = message(SWEEP)
    assert made.start.ToMicroseconds() == pytest.approx(1_800_000_000_250_000, abs=1, rel=0)
    assert made.clock_error_s == 0.001
    assert not made.HasField("pose")


@given(SWEEPS, st.floats(-0.03, 0.03))
def test_whatever_the_line_can_carry_makes_a_message_that_no_reader_refuses(sweep: Sweep, drift: float) -> None:
    bounds.check(message(sweep, drift=drift))


def test_a_temperature_that_no_air_has_is_left_out() -> None:
    assert not message(replace(SWEEP, temperature=32767)).HasField("air_temperature_c")
