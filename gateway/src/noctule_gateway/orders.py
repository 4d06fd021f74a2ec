"""What a unit is told to do, from SI units to the wire's integers. ``request`` is 0: the link numbers what it sends."""

from dataclasses import replace
from typing import TypeVar

from noctule.messages_pb2 import CommandRequest, SweepPlan
from noctule_gateway.codec import encode
from noctule_gateway.errors import CommandError, FrameError
from noctule_gateway.frames import NO_WAYPOINT, Configure, Home, Order, SetWaypoint, Single, Start, Stop
from noctule_gateway.sweep import BEARING_RAD

# A unit's own plan: firmware/README.md, "Host to unit".
DEFAULT_PLAN = Configure(
    request=0,
    first_bearing=-24576,  # -135 degrees
    bearing_step=4096,  # 22.5 degrees
    count=13,
    ping_interval_ms=60,
    top_speed=600,
    ramp_ms=100,
    settle_ms=20,
    pings=1,
)

T = TypeVar("T", bound=Order)

ORDERS = ("configure", "start", "stop", "single", "home", "set_waypoint")


def configure(plan: SweepPlan, present: Configure) -> Configure:
    """``plan`` over the ``present`` one. Raises CommandError if a value does not fit the frame."""
    scales = {
        "first_bearing": ("first_bearing_rad", 1 / BEARING_RAD),
        "bearing_step": ("bearing_step_rad", 1 / BEARING_RAD),
        "count": ("count", 1),
        "ping_interval_ms": ("ping_interval_s", 1000),
        "top_speed": ("top_speed_half_steps_s", 1),
        "ramp_ms": ("ramp_s", 1000),
        "settle_ms": ("settle_s", 1000),
    }
    given = {
        wire: _integer(name, getattr(plan, name), scale)
        for wire, (name, scale) in scales.items()
        if plan.HasField(name)
    }
    return _fitting(replace(present, **given))


def start(pause_s: float) -> Start:
    """Sweep until told to stop, with ``pause_s`` between two sweeps. Raises CommandError if that does not fit."""
    return _fitting(Start(0, _integer("pause_s", pause_s, 1000)))


def order(name: str, request: CommandRequest, present: Configure) -> Order:
    """The order that the command ``name`` (one of ORDERS) means. Raises CommandError if it makes no sense."""
    match name:
        case "configure":
            return configure(request.plan, present)
        case "start":
            return start(request.pause_s)
        case "stop":
            return Stop(0)
        case "single":
            return Single(0)
        case "home":
            return Home(0)
        case "set_waypoint":
            return _fitting(SetWaypoint(0, request.waypoint if request.HasField("waypoint") else NO_WAYPOINT))
    raise CommandError(f"there is no command {name!r}: there are {', '.join(ORDERS)}")


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
