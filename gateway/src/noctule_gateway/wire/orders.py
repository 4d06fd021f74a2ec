"""What a unit is told to do, from SI units to the wire's integers. ``request`` is 0: the link numbers what it sends."""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from noctule.bounds import Number
from noctule.messages_pb2 import Calibration, CommandRequest, SweepPlan
from noctule_gateway.errors import CommandError, FrameError
from noctule_gateway.wire import limits
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import (
    NO_WAYPOINT,
    Calibrate,
    Configure,
    GoTo,
    Home,
    Order,
    Reset,
    Settings,
    SetWaypoint,
    Single,
    Start,
    Stop,
    Store,
    TrimTemperature,
)
from noctule_gateway.wire.settings_message import HOMES, calibration_of, plan_of
from noctule_gateway.wire.units import CALIBRATION, PER_KELVIN, PER_RADIAN, PER_SECOND, PLAN, Scale

T = TypeVar("T", bound=Order)


def configure(plan: SweepPlan, present: Configure) -> Configure:
    """``plan`` over the ``present`` one, which older firmware may have taken though it is faster than a unit takes now.
    Raises CommandError, which names the field, if a unit would not take ``plan``.
    """
    limits.check_fields(plan, limits.PLAN_BOUNDS)
    order = as_written(plan, limits.eased(present))
    limits.check_ramp(order)
    return order


def as_written(plan: SweepPlan, present: Configure) -> Configure:
    """configure(), but a plan stays that only older firmware takes: a ramp too short for the top speed was valid before
    0.4, a top speed of up to 1000 half steps/s before 0.6.
    """
    limits.check_fields(plan, limits.WRITTEN_PLAN_BOUNDS)
    given = _given(plan, PLAN)
    if "first_bearing" in given:
        given["first_bearing"] = limits.within_outermost(given["first_bearing"])
    order = _fitting(replace(present, **given))
    if plan.ListFields():
        limits.check_last_bearing(order)
    return order


def calibrate(calibration: Calibration, present: Calibrate) -> Calibrate:
    """``calibration`` over the ``present`` one. Raises CommandError, which names the field, if a unit won't take it."""
    limits.check_fields(calibration, limits.CALIBRATION_BOUNDS)
    given = _given(calibration, CALIBRATION)
    if calibration.HasField("home"):
        kinds = {home: kind for kind, home in HOMES.items()}
        if calibration.home not in kinds:
            kinds_known = ", ".join(Calibration.Home.Name(home) for home in kinds)
            raise CommandError(f"home {calibration.home} is no kind of home: give one of {kinds_known}")
        given["home"] = kinds[calibration.home]
    return _fitting(replace(present, **given))


def start(pause_s: float) -> Start:
    """Sweep until told to stop, with ``pause_s`` between two sweeps. Raises CommandError if that does not fit."""
    limits.check("pause_s", pause_s, limits.PAUSE_S)
    return _fitting(Start(0, _integer("pause_s", pause_s, PER_SECOND)))


def _set_waypoint(request: CommandRequest, waypoints: Number) -> SetWaypoint:
    if not request.HasField("waypoint"):
        return SetWaypoint(0, NO_WAYPOINT)
    limits.check("waypoint", request.waypoint, waypoints)
    return SetWaypoint(0, request.waypoint)


def _go_to(request: CommandRequest) -> GoTo:
    bearing = _needed(request, "bearing_rad", PER_RADIAN, limits.BEARING_RAD)
    return GoTo(0, limits.within_outermost(bearing))


def _trim_temperature(request: CommandRequest) -> TrimTemperature:
    return _fitting(TrimTemperature(0, _needed(request, "temperature_c", PER_KELVIN, limits.TRIM_AIR_C)))


_SIMPLE: dict[str, Callable[[CommandRequest, Number], Order]] = {
    "start": lambda request, _: start(request.pause_s),
    "stop": lambda *_: Stop(0),
    "single": lambda *_: Single(0),
    "home": lambda *_: Home(0),
    "set_waypoint": _set_waypoint,
    "go_to": lambda request, _: _go_to(request),
    "trim_temperature": lambda request, _: _trim_temperature(request),
    "store": lambda *_: Store(0),
    "reset": lambda *_: Reset(0),
}
# What changes a part of the unit's settings needs the rest of them.
_OVER_PRESENT: dict[str, Callable[[CommandRequest, Settings], Order]] = {
    "configure": lambda request, present: configure(request.plan, plan_of(present)),
    "calibrate": lambda request, present: calibrate(request.calibration, calibration_of(present)),
}


def needs_settings(name: str) -> bool:
    """The command ``name`` is told by order_over() and not by order()."""
    return name in _OVER_PRESENT


def order(name: str, request: CommandRequest, waypoints: Number = limits.WAYPOINT) -> Order:
    """The order that the command ``name`` means to a unit that may be at ``waypoints``. Raises CommandError if it makes
    no sense.
    """
    if name not in _SIMPLE:
        known = ", ".join(sorted([*_SIMPLE, *_OVER_PRESENT]))
        raise CommandError(f"there is no command {name!r}: there are {known}")
    return _SIMPLE[name](request, waypoints)


def order_over(name: str, request: CommandRequest, present: Settings) -> Order:
    """The order that the command ``name`` means to a unit that goes by ``present``. Raises CommandError."""
    return _OVER_PRESENT[name](request, present)


def _given(message: SweepPlan | Calibration, scales: dict[str, Scale]) -> dict[str, int]:
    """The wire's integers of the fields that are set."""
    return {
        wire: _integer(name, getattr(message, name), scale)
        for wire, (name, scale) in scales.items()
        if message.HasField(name)
    }


def _needed(request: CommandRequest, name: str, scale: float, bound: Number) -> int:
    if not request.HasField(name):
        raise CommandError(f"{name} is not set: give it")
    limits.check(name, getattr(request, name), bound)
    return _integer(name, getattr(request, name), scale)


def _integer(name: str, value: float, scale: float) -> int:
    try:
        return round(value * scale)
    except (ValueError, OverflowError) as error:
        raise CommandError(f"{name} is {value}: give a finite number") from error


def _fitting(order: T) -> T:
    try:
        encode(order)
    except FrameError as error:
        raise CommandError(f"out of range: {error}") from error
    return order
