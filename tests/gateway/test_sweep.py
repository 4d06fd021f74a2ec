"""From the wire's integers to SI units and back: expected figures are firmware/README.md's definitions."""

from dataclasses import replace
from math import inf, nan, pi

import pytest

from noctule import messages_pb2 as messages
from noctule.messages_pb2 import CommandRequest, SweepPlan
from noctule.site import FixedPose, Pose2, Sensor, Site, Unit
from noctule_gateway import frames, orders
from noctule_gateway.clock import HostTime
from noctule_gateway.errors import CommandError
from noctule_gateway.frames import NO_TEMPERATURE, NO_WAYPOINT, NoEcho, Reading, Sweep
from noctule_gateway.orders import DEFAULT_PLAN
from noctule_gateway.sweep import to_message

UNIT = Unit("u1", 7, "socket://h:1", FixedPose(Pose2(0, 0, 0)), Sensor(), None, False, 0.0)
SITE = Site("s", (UNIT,), None, "utc")
SWEEP = Sweep(1, 2, 3, NO_WAYPOINT, NO_TEMPERATURE, 0, ())
START = HostTime(1_800_000_000.25, 0.001)


def message(sweep: Sweep, site: Site = SITE) -> messages.Sweep:
    return to_message(sweep, site, UNIT, START, None)


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


def test_the_units_temperature_goes_before_the_sites_and_neither_is_nothing() -> None:
    warm = replace(SITE, air_temperature_c=21.0)
    assert message(replace(SWEEP, temperature=-512), warm).air_temperature_c == -5.12
    assert message(SWEEP, warm).air_temperature_c == 21.0
    assert not message(SWEEP).HasField("air_temperature_c")


def test_start_keeps_its_time_to_the_microsecond_and_an_absent_pose_stays_absent() -> None:
    made = message(SWEEP)
    assert made.start.ToMicroseconds() == pytest.approx(1_800_000_000_250_000, abs=1, rel=0)
    assert made.clock_error_s == 0.001
    assert not made.HasField("pose")


def test_a_plan_keeps_the_present_value_of_what_it_leaves_out() -> None:
    plan = orders.configure(SweepPlan(first_bearing_rad=-pi / 2, ping_interval_s=0.05, ramp_s=0.2), DEFAULT_PLAN)
    assert plan == replace(DEFAULT_PLAN, first_bearing=-16384, ping_interval_ms=50, ramp_ms=200)


def test_waypoint_none_is_what_the_wire_calls_none() -> None:
    assert orders.order("set_waypoint", CommandRequest(), DEFAULT_PLAN) == frames.SetWaypoint(0, NO_WAYPOINT)
    assert orders.order("set_waypoint", CommandRequest(waypoint=0), DEFAULT_PLAN) == frames.SetWaypoint(0, 0)


@pytest.mark.parametrize(
    ("name", "request_"),
    [
        ("configure", CommandRequest(plan=SweepPlan(first_bearing_rad=4.0))),
        ("configure", CommandRequest(plan=SweepPlan(bearing_step_rad=-0.1))),
        ("configure", CommandRequest(plan=SweepPlan(settle_s=nan))),
        ("start", CommandRequest(pause_s=66.0)),
        ("start", CommandRequest(pause_s=inf)),
        ("set_waypoint", CommandRequest(waypoint=65536)),
    ],
)
def test_what_does_not_fit_the_wire_is_refused_before_it_is_sent(name: str, request_: CommandRequest) -> None:
    with pytest.raises(CommandError):
        orders.order(name, request_, DEFAULT_PLAN)
