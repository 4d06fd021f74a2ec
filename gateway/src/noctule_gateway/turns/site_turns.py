"""The timetable of a site file."""

from collections.abc import Mapping
from math import pi, sqrt

from noctule.site import FixedPose, Site, Unit, UnknownPose
from noctule_gateway.turns.hearing import LOBE_RAD, Place, could_hear
from noctule_gateway.turns.timetable import LISTENS_S, Crowd, Pace, Turn, timetable
from noctule_gateway.wire.frames import Configure
from noctule_gateway.wire.units import BEARING_RAD, HALF_STEPS_PER_TURN

_ROUNDS_S = 0.006  # of 2 ms: until the motor is found at rest, until it is settled, until the ping
_BEARINGS_PER_TURN = 65536


def site_turns(site: Site, plans: Mapping[str, Configure]) -> dict[str, Turn | Crowd]:
    """Which unit of ``site`` may ping when; units that need no turns are left out.

    Turns are for units that stay where they are. One that is carried, or tracked, pings as it is asked to. One whose
    place is not known yet could hear all of its room. ``plans`` has the plan of each unit.
    """
    if site.clock == "unit":  # each unit's time is its own there
        return {}
    standing = [unit for unit in site.units if isinstance(unit.pose, FixedPose | UnknownPose)]
    heard = {
        unit.name: [other.name for other in standing if other is not unit and _share_a_room(unit, other, plans)]
        for unit in standing
    }
    return timetable({unit.name: pace_of(plans[unit.name]) for unit in standing}, heard)


def not_reckoned_with(
    site: Site, plans: Mapping[str, Configure], turns: Mapping[str, Turn | Crowd], name: str, plan: Configure
) -> list[str]:
    """The units that could hear unit ``name`` if it goes by ``plan`` in place of its own in ``plans``, out of turn.

    For they could not by ``plans``, so ``turns`` lets them ping at the same time.
    """
    unit = site.unit(name)
    others = [each for each in site.units if each.name != name and isinstance(each.pose, FixedPose)]
    if site.clock == "unit" or not isinstance(unit.pose, FixedPose):
        return []
    return [
        other.name
        for other in others
        if not _one_after_the_other(turns.get(name), turns.get(other.name))
        and _share_a_room(unit, other, {**plans, name: plan})
        and not _share_a_room(unit, other, plans)
    ]


def _one_after_the_other(one: Turn | Crowd | None, other: Turn | Crowd | None) -> bool:
    if not (isinstance(one, Turn) and isinstance(other, Turn)):
        return False
    return one.period_s == other.period_s and one.offset_s != other.offset_s


def pace_of(plan: Configure) -> Pace:
    """How long a reading of ``plan`` takes at most, by the usual gear. The others that a unit takes differ by 8 %."""
    half_steps = plan.bearing_step * HALF_STEPS_PER_TURN / _BEARINGS_PER_TURN
    ramp_s, speed = plan.ramp_ms / 1000, plan.top_speed
    at_full_speed = half_steps >= speed * ramp_s
    turn_s = half_steps / speed + ramp_s if at_full_speed else 2 * sqrt(half_steps * ramp_s / speed)
    listens_s = LISTENS_S + 0.002  # a sensor that hears nothing holds ECHO for 38 ms
    interval_s = max(plan.ping_interval_ms / 1000, listens_s)
    return Pace(turn_s + plan.settle_ms / 1000 + listens_s + _ROUNDS_S, plan.pings, interval_s)


def _share_a_room(one: Unit, other: Unit, plans: Mapping[str, Configure]) -> bool:
    if one.room and other.room and one.room != other.room:
        return False
    places = [_place(unit, plans[unit.name]) for unit in (one, other)]
    return any(place is None for place in places) or could_hear(*(place for place in places if place is not None))


def _place(unit: Unit, plan: Configure) -> Place | None:
    if not isinstance(unit.pose, FixedPose):
        return None
    pose = unit.pose.pose
    spare_rad = LOBE_RAD + 3 * pose.sigma_heading_rad
    first_rad = pose.heading_rad + plan.first_bearing * BEARING_RAD - spare_rad
    width_rad = plan.bearing_step * (plan.count - 1) * BEARING_RAD + 2 * spare_rad
    return Place(pose.x_m, pose.y_m, first_rad, min(width_rad, 2 * pi), pose.sigma_position_m)
