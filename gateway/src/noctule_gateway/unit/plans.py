"""Which plan a unit gets, by how it stands: the one place that says what a site file's silence means."""

import logging
from dataclasses import replace

from noctule.messages_pb2 import SweepPlan
from noctule.site import FixedPose, Unit
from noctule_gateway.errors import CommandError
from noctule_gateway.wire import limits, orders
from noctule_gateway.wire.frames import Configure

_log = logging.getLogger(__name__)

# A unit's own plan: firmware/README.md, "Host to unit". For a unit that is carried: each place hears a reflector once.
OWN_PLAN = Configure(
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

# For a unit that stays where it is: so fine that several bearings hear each reflector, which gives its direction. The
# 51 half steps between two bearings are mostly ramp, so half the ramp makes the sweep a fifth shorter. The top speed
# stays at 600 half steps/s, which needs a ramp: from rest, a 28BYJ-48 follows 500 (firmware/src/core/plan.c).
FIXED_PLAN = replace(OWN_PLAN, bearing_step=819, count=61, ramp_ms=50)  # 4.5 degrees, as far as the coarse plan

_BEARINGS = ("first_bearing_rad", "bearing_step_rad", "count")


def wanted_plan(unit: Unit) -> Configure | None:
    """What the gateway gives ``unit``; None leaves the unit the plan that it has.

    A fixed unit whose site file names no bearings gets FIXED_PLAN under what else the file says. Bearings that the file
    gives in part are completed by OWN_PLAN. A top speed over 800 half steps/s and a ramp too short for it are eased,
    with a warning: older firmware took them, and an upgrade must not stop the gateway. Raises CommandError if a unit
    would not take the file's plan for another reason.
    """
    plan = _given_plan(unit)
    return plan and _eased(unit.name, plan)


def expected_plan(unit: Unit) -> Configure:
    """The plan that ``unit`` will most likely go by. Raises CommandError as wanted_plan()."""
    return limits.eased(_given_plan(unit) or OWN_PLAN)


def _given_plan(unit: Unit) -> Configure | None:
    """As the site file has it."""
    given = unit.plan or SweepPlan()
    try:
        if isinstance(unit.pose, FixedPose) and not any(map(given.HasField, _BEARINGS)):
            return orders.as_written(given, FIXED_PLAN)
        return orders.as_written(given, OWN_PLAN) if unit.plan else None
    except CommandError as error:
        raise CommandError(f"the site file's plan of unit {unit.name}: {error}") from error


def _eased(name: str, plan: Configure) -> Configure:
    eased = limits.eased(plan)
    if eased.top_speed != plan.top_speed:
        _log.warning(
            "%s: %d half steps/s are more than a unit takes, so it gets %d: write top_speed_half_steps_s = %d into the "
            "sweep table of the site file",
            name,
            plan.top_speed,
            eased.top_speed,
            eased.top_speed,
        )
    if eased.ramp_ms != plan.ramp_ms:
        _log.warning(
            "%s: a ramp of %g s is too short for %d half steps/s, so the unit gets one of %g s: "
            "write ramp_s = %g into the sweep table of the site file",
            name,
            plan.ramp_ms / 1000,
            eased.top_speed,
            eased.ramp_ms / 1000,
            eased.ramp_ms / 1000,
        )
    return eased
