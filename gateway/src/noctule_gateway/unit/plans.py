"""Which plan a unit gets, by how it stands: the one place that says what a site file's silence means."""

from dataclasses import replace

from noctule.messages_pb2 import SweepPlan
from noctule.site import FixedPose, Unit
from noctule_gateway.errors import CommandError
from noctule_gateway.wire import orders
from noctule_gateway.wire.frames import Configure

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
# stays at 600 half steps/s, about what a 28BYJ-48 follows without any ramp.
FIXED_PLAN = replace(OWN_PLAN, bearing_step=819, count=61, ramp_ms=50)  # 4.5 degrees, as far as the coarse plan

_BEARINGS = ("first_bearing_rad", "bearing_step_rad", "count")


def wanted_plan(unit: Unit) -> Configure | None:
    """What the gateway gives ``unit``; None leaves the unit the plan that it has.

    A fixed unit whose site file names no bearings gets FIXED_PLAN under what else the file says. Bearings that the file
    gives in part are completed by OWN_PLAN. Raises CommandError if a unit would not take the file's plan.
    """
    given = unit.plan or SweepPlan()
    try:
        if isinstance(unit.pose, FixedPose) and not any(map(given.HasField, _BEARINGS)):
            return orders.configure(given, FIXED_PLAN)
        return orders.configure(given, OWN_PLAN) if unit.plan else None
    except CommandError as error:
        raise CommandError(f"the site file's plan of unit {unit.name}: {error}") from error
