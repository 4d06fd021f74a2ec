"""Commands of the bus to orders, and settings back: expected figures are firmware/README.md's definitions."""

from dataclasses import replace
from math import inf, nan, pi, radians

import pytest
from gateway.model_unit import ModelUnit
from hypothesis import given
from hypothesis import strategies as st

from noctule.messages_pb2 import Calibration, CommandRequest, SweepPlan
from noctule.site import FixedPose, Pose2, WaypointPath
from noctule_gateway.errors import CommandError
from noctule_gateway.unit.plans import OWN_PLAN
from noctule_gateway.wire import frames, limits, orders, settings_message
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import NO_WAYPOINT, Calibrate, HomeKind, Settings

CALIBRATION = Calibrate(0, 1_043_397, 0, HomeKind.SWITCH, -27307)
SETTINGS = Settings(
    *(0, 1, -24576, 4096, 13, 60, 600, 100, 20, 1),  # stored, and the default plan
    *(1_043_397, 3, HomeKind.STOP, -30000, -250),
)


def test_a_plan_keeps_the_present_value_of_what_it_leaves_out() -> None:
    plan = orders.configure(SweepPlan(first_bearing_rad=-0.8 * pi, ping_interval_s=0.05, ramp_s=0.2), OWN_PLAN)
    assert plan == replace(OWN_PLAN, first_bearing=-26214, ping_interval_ms=50, ramp_ms=200)
    assert orders.configure(SweepPlan(pings=5), OWN_PLAN) == replace(OWN_PLAN, pings=5)


def test_a_calibration_keeps_the_present_value_of_what_it_leaves_out() -> None:
    measured = Calibration(half_steps_per_turn=4080.5, backlash_half_steps=7)
    assert orders.calibrate(measured, CALIBRATION) == replace(
        CALIBRATION, half_steps_per_turn=4080 * 256 + 128, backlash=7
    )
    stop = Calibration(home=Calibration.HOME_STOP, home_bearing_rad=-pi)
    assert orders.calibrate(stop, CALIBRATION) == replace(CALIBRATION, home=HomeKind.STOP, home_bearing=-32768)
    opening = Calibration(home=Calibration.HOME_OPENING_SWITCH, backlash_half_steps=128)
    assert orders.calibrate(opening, CALIBRATION) == replace(CALIBRATION, home=HomeKind.OPENING_SWITCH, backlash=128)


def test_a_fast_plan_needs_a_ramp() -> None:
    fast = SweepPlan(top_speed_half_steps_s=501, ramp_s=0.05)
    assert orders.configure(fast, OWN_PLAN) == replace(OWN_PLAN, top_speed=501, ramp_ms=50)
    assert orders.configure(SweepPlan(top_speed_half_steps_s=500, ramp_s=0), OWN_PLAN).ramp_ms == 0
    with pytest.raises(CommandError, match=r"ramp_s is 0\.049 at 501 half steps/s: give 0\.05 s or more"):
        orders.configure(SweepPlan(top_speed_half_steps_s=501, ramp_s=0.049), OWN_PLAN)


@pytest.mark.parametrize("plan", [SweepPlan(), SweepPlan(pings=1)])
def test_a_plan_that_older_firmware_took_is_eased_where_it_is_not_given_anew(plan: SweepPlan) -> None:
    fast = replace(OWN_PLAN, top_speed=1000, ramp_ms=0)
    assert orders.configure(plan, fast) == replace(OWN_PLAN, top_speed=800, ramp_ms=50)


def test_settings_come_to_the_bus_in_si_units() -> None:
    told = settings_message.to_message(SETTINGS)
    assert told.stored
    assert told.plan.first_bearing_rad == pytest.approx(-0.75 * pi)
    assert (told.plan.bearing_step_rad, told.plan.count, told.plan.pings) == (pytest.approx(pi / 8), 13, 1)
    assert (told.plan.ping_interval_s, told.plan.ramp_s, told.plan.settle_s) == (0.06, 0.1, 0.02)
    # 25792/405 * 64, the gear train's ratio, to a 256th of a half step
    assert told.calibration.half_steps_per_turn == pytest.approx(25792 / 405 * 64, abs=1 / 256)
    assert (told.calibration.backlash_half_steps, told.calibration.home) == (3, Calibration.HOME_STOP)
    assert told.calibration.home_bearing_rad == pytest.approx(-30000 / 65536 * 2 * pi)
    assert told.temperature_trim_k == -2.5
    untrimmed = settings_message.to_message(replace(SETTINGS, temperature_trim=frames.NO_TEMPERATURE))
    assert not untrimmed.HasField("temperature_trim_k")


def test_settings_that_are_ordered_as_they_were_told_are_the_same_settings() -> None:
    told = settings_message.to_message(SETTINGS)
    unit = ModelUnit()
    assert orders.configure(told.plan, unit.plan) == settings_message.plan_of(SETTINGS)
    assert orders.calibrate(told.calibration, unit.calibration) == settings_message.calibration_of(SETTINGS)


@pytest.mark.parametrize(
    ("name", "request_", "order"),
    [
        ("set_waypoint", CommandRequest(), frames.SetWaypoint(0, NO_WAYPOINT)),
        ("set_waypoint", CommandRequest(waypoint=0), frames.SetWaypoint(0, 0)),
        ("go_to", CommandRequest(bearing_rad=-pi / 4), frames.GoTo(0, -8192)),
        ("trim_temperature", CommandRequest(temperature_c=-5.12), frames.TrimTemperature(0, -512)),
        ("store", CommandRequest(), frames.Store(0)),
        ("reset", CommandRequest(), frames.Reset(0)),
    ],
)
def test_a_command_is_the_order_of_the_wire(name: str, request_: CommandRequest, order: frames.Order) -> None:
    assert orders.order(name, request_) == order


@pytest.mark.parametrize(
    ("name", "request_"),
    [
        ("configure", CommandRequest(plan=SweepPlan(first_bearing_rad=4.0))),
        ("configure", CommandRequest(plan=SweepPlan(bearing_step_rad=-0.1))),
        ("configure", CommandRequest(plan=SweepPlan(settle_s=nan))),
        ("configure", CommandRequest(plan=SweepPlan(pings=256))),
        ("calibrate", CommandRequest(calibration=Calibration(half_steps_per_turn=-1.0))),
        ("calibrate", CommandRequest(calibration=Calibration(backlash_half_steps=256))),
        ("calibrate", CommandRequest(calibration=Calibration(home=Calibration.HOME_UNSPECIFIED))),
    ],
)
def test_settings_that_do_not_fit_the_wire_are_refused_before_they_are_sent(
    name: str, request_: CommandRequest
) -> None:
    assert orders.needs_settings(name)
    with pytest.raises(CommandError):
        orders.order_over(name, request_, SETTINGS)


@pytest.mark.parametrize(
    ("name", "request_"),
    [
        ("start", CommandRequest(pause_s=66.0)),
        ("start", CommandRequest(pause_s=inf)),
        ("set_waypoint", CommandRequest(waypoint=65536)),
        ("go_to", CommandRequest(bearing_rad=pi)),
        ("go_to", CommandRequest()),
        ("trim_temperature", CommandRequest(temperature_c=400.0)),
        ("trim_temperature", CommandRequest()),
        ("jump", CommandRequest()),
    ],
)
def test_what_does_not_fit_the_wire_is_refused_before_it_is_sent(name: str, request_: CommandRequest) -> None:
    with pytest.raises(CommandError):
        orders.order(name, request_)


def test_a_waypoint_beyond_the_units_path_is_refused() -> None:
    here = Pose2(0.0, 0.0, 0.0)
    path = limits.waypoints_of(WaypointPath((here,) * 44))
    last = CommandRequest(waypoint=43)
    assert orders.order("set_waypoint", last, path) == frames.SetWaypoint(0, 43)
    assert orders.order("set_waypoint", CommandRequest(), path) == frames.SetWaypoint(0, NO_WAYPOINT)
    with pytest.raises(CommandError, match=r"^out of range: waypoint is 999: give 0 to 43$"):
        orders.order("set_waypoint", CommandRequest(waypoint=999), path)
    assert orders.order("set_waypoint", CommandRequest(waypoint=999), limits.waypoints_of(FixedPose(here)))


@pytest.mark.parametrize(
    ("command", "request_", "told"),
    [
        *(
            ("configure", CommandRequest(plan=plan), told)
            for plan, told in (
                (SweepPlan(first_bearing_rad=radians(150)), "first_bearing_deg is 150: give -148 to 148 degrees"),
                (SweepPlan(bearing_step_rad=radians(-5)), "bearing_step_deg is -5: give 0.00549316 to 360 degrees"),
                (SweepPlan(count=65), "count is 65: give 1 to 64"),
                (SweepPlan(count=0), "count is 0: give 1 to 64"),
                (SweepPlan(ping_interval_s=0.01), "ping_interval_s is 0.01: give 0.029 to 1 s (in seconds)"),
                (
                    SweepPlan(top_speed_half_steps_s=2000),
                    "top_speed_half_steps_s is 2000: give 50 to 800 half steps/s",
                ),
                (SweepPlan(settle_s=nan), "settle_s is nan: give 0 to 1 s (in seconds)"),
                (SweepPlan(pings=2), "pings is 2: give 1, 3, 5"),
                (
                    SweepPlan(first_bearing_rad=0.0, bearing_step_rad=radians(22.5), count=8),
                    "the last bearing, first_bearing_deg + (count - 1) * bearing_step_deg, is 0 + 7 * 22.5 = 157.5: "
                    "give fewer or closer bearings, up to 148 degrees",
                ),
            )
        ),
        *(
            ("calibrate", CommandRequest(calibration=calibration), told)
            for calibration, told in (
                (Calibration(half_steps_per_turn=2048), "half_steps_per_turn is 2048: give 3800 to 4400"),
                (Calibration(backlash_half_steps=129), "backlash_half_steps is 129: give 0 to 128"),
                (Calibration(home_bearing_rad=0.0), "home_bearing_deg is 0: give -180 to -148 degrees"),
            )
        ),
        ("go_to", CommandRequest(bearing_rad=radians(149)), "bearing_deg is 149: give -148 to 148 degrees"),
        ("trim_temperature", CommandRequest(temperature_c=294), "temperature_c is 294: give -40 to 85 degrees C"),
        ("start", CommandRequest(pause_s=66), "pause_s is 66: give 0 to 65.535 s (in seconds)"),
        ("set_waypoint", CommandRequest(waypoint=0xFFFF), "waypoint is 65535: give 0 to 65534"),
    ],
)
def test_what_a_unit_would_refuse_is_refused_by_its_field_in_the_operators_units(
    command: str, request_: CommandRequest, told: str
) -> None:
    """The limits: firmware/README.md, "Host to unit". 0xFFFF is no waypoint."""
    with pytest.raises(CommandError) as refusal:
        if orders.needs_settings(command):
            orders.order_over(command, request_, SETTINGS)
        else:
            orders.order(command, request_)
    assert str(refusal.value) == f"out of range: {told}"


@pytest.mark.parametrize("bearing_deg", [-148, 148])
def test_the_outermost_bearings_are_allowed_in_a_plan_and_to_go_to(bearing_deg: int) -> None:
    plan = SweepPlan(first_bearing_rad=radians(bearing_deg), count=1)
    made = orders.order_over("configure", CommandRequest(plan=plan), SETTINGS)
    assert isinstance(made, frames.Configure)
    # firmware/src/core/plan.c: OUTERMOST is 148 * 65536 / 360 without what is not whole; to the nearest is refused.
    assert made.first_bearing == int(bearing_deg * 65536 / 360) != round(bearing_deg * 65536 / 360)
    assert orders.order("go_to", CommandRequest(bearing_rad=radians(bearing_deg))) == frames.GoTo(0, made.first_bearing)


NUMBERS = st.none() | st.floats() | st.floats(-10, 5000)
COUNTS = st.none() | st.integers(0, 2**32 - 1) | st.integers(0, 100)


def some(message: type, numbers: tuple[str, ...], counts: tuple[str, ...]) -> st.SearchStrategy:
    """A message with some of these fields set."""
    return st.builds(message, **dict.fromkeys(numbers, NUMBERS), **dict.fromkeys(counts, COUNTS))


PLAN_NUMBERS = (
    *("first_bearing_rad", "bearing_step_rad", "ping_interval_s"),
    *("top_speed_half_steps_s", "ramp_s", "settle_s"),
)


@given(
    command=st.sampled_from(
        ["start", "set_waypoint", "go_to", "trim_temperature", "configure", "calibrate", "jump", ""]
    ),
    plan=some(SweepPlan, PLAN_NUMBERS, ("count", "pings")),
    calibration=some(Calibration, ("half_steps_per_turn", "home_bearing_rad"), ("backlash_half_steps",)),
    numbers=st.fixed_dictionaries({name: NUMBERS for name in ("pause_s", "bearing_rad", "temperature_c")}),
    waypoint=COUNTS,
)
def test_any_command_is_an_order_that_fits_the_wire_or_refused(command, plan, calibration, numbers, waypoint) -> None:
    request = CommandRequest(plan=plan, calibration=calibration, waypoint=waypoint, **numbers)
    try:
        if orders.needs_settings(command):
            order = orders.order_over(command, request, SETTINGS)
        else:
            order = orders.order(command, request)
    except CommandError:
        return
    encode(order)
