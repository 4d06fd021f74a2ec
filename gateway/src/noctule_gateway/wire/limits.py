"""What a unit takes of each quantity: firmware/README.md, CONFIGURE, CALIBRATE, GO_TO, START and TRIM_TEMPERATURE.

A unit only answers that something is out of range. So the gateway says first what is, in the operator's units.
"""

from dataclasses import replace
from math import degrees, radians

from noctule.bounds import UNIT_PAUSE_S, UNIT_PLAN, Number
from noctule.messages_pb2 import Calibration, SweepPlan
from noctule.site import PINGS, PoseSource, WaypointPath
from noctule_gateway.errors import CommandError
from noctule_gateway.wire.frames import Configure
from noctule_gateway.wire.units import PER_RADIAN

WRITTEN_PLAN_BOUNDS = UNIT_PLAN | {"pings": Number(PINGS[0], PINGS[-1])}
_FASTEST = 800  # half steps/s
_TOP_SPEED = Number(UNIT_PLAN["top_speed_half_steps_s"].least, _FASTEST, "half steps/s")
PLAN_BOUNDS = WRITTEN_PLAN_BOUNDS | {"top_speed_half_steps_s": _TOP_SPEED}
CALIBRATION_BOUNDS = {
    "half_steps_per_turn": Number(3800, 4400),
    "backlash_half_steps": Number(0, 128),
    "home_bearing_rad": Number(-radians(180), -radians(148), "rad"),
}
PAUSE_S = UNIT_PAUSE_S
BEARING_RAD = UNIT_PLAN["first_bearing_rad"]
WAYPOINT = Number(0, 0xFFFE)
TRIM_AIR_C = Number(-40, 85, "degrees C")

_ROUNDING = 1e-6  # of a quantity that went through other units
_FASTEST_FROM_REST = 500  # half steps/s
_SHORTEST_RAMP_MS = 50
_OUTERMOST = int(BEARING_RAD.most * PER_RADIAN)  # as firmware/src/core/plan.c, which cuts off what is not whole


def check(field: str, value: float, bound: Number) -> None:
    """Raise CommandError where ``value`` is beyond ``bound``; angles are named and given in degrees."""
    if bound.least - _ROUNDING <= value <= bound.most + _ROUNDING:  # False for NaN
        return
    if bound.unit == "rad":
        named = f"{field.removesuffix('_rad')}_deg is {degrees(value):.6g}"
        raise CommandError(f"out of range: {named}: {bound.allowed(degrees(1), 'degrees')}")
    raise CommandError(f"out of range: {field} is {value:.6g}: {bound.allowed()}")


def waypoints_of(source: PoseSource) -> Number:
    """The waypoints that the unit may be told to be at: those of its path, where it has one."""
    return Number(0, len(source.poses) - 1) if isinstance(source, WaypointPath) else WAYPOINT


def check_fields(message: SweepPlan | Calibration, bounds: dict[str, Number]) -> None:
    """Raise CommandError at the first field of ``message`` that is set and beyond its bound."""
    for field, bound in bounds.items():
        if message.HasField(field):
            check(field, getattr(message, field), bound)
    if isinstance(message, SweepPlan) and message.HasField("pings") and message.pings not in PINGS:
        raise CommandError(f"out of range: pings is {message.pings}: give {', '.join(map(str, PINGS))}")


def within_outermost(bearing: int) -> int:
    """The wire's ``bearing``, checked in radians before: what rounding has put beyond the outermost is that one."""
    return max(-_OUTERMOST, min(_OUTERMOST, bearing))


def check_last_bearing(plan: Configure) -> None:
    """Raise CommandError where ``plan`` leads beyond what a unit can look at."""
    last = plan.first_bearing + plan.bearing_step * (plan.count - 1)
    if last > _OUTERMOST:
        raise CommandError(
            "out of range: the last bearing, first_bearing_deg + (count - 1) * bearing_step_deg, is "
            f"{degrees(plan.first_bearing / PER_RADIAN):.6g} + {plan.count - 1} * "
            f"{degrees(plan.bearing_step / PER_RADIAN):.6g} = {degrees(last / PER_RADIAN):.6g}: "
            f"give fewer or closer bearings, up to {degrees(BEARING_RAD.most):.6g} degrees"
        )


def eased(plan: Configure) -> Configure:
    """``plan`` no faster than a unit takes it, and with the shortest ramp that its top speed allows, if its own is
    shorter. Older firmware took more.
    """
    top_speed = min(plan.top_speed, _FASTEST)
    least_ramp_ms = _SHORTEST_RAMP_MS if top_speed > _FASTEST_FROM_REST else 0
    return replace(plan, top_speed=top_speed, ramp_ms=max(plan.ramp_ms, least_ramp_ms))


def check_ramp(plan: Configure) -> None:
    """Raise CommandError where ``plan`` has the motor start faster than it can from rest."""
    if eased(plan).ramp_ms != plan.ramp_ms:
        raise CommandError(
            f"out of range: ramp_s is {plan.ramp_ms / 1000:.6g} at {plan.top_speed} half steps/s: give "
            f"{_SHORTEST_RAMP_MS / 1000:.6g} s or more, or a top speed of {_FASTEST_FROM_REST} half steps/s or less"
        )
