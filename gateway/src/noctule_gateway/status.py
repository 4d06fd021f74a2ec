"""What the bus is told of a unit: its state, a sentence for the operator when something is wrong, the counters."""

from dataclasses import dataclass

from noctule.messages_pb2 import UnitStatus
from noctule.site import PoseKey, Unit, WaypointPath
from noctule_gateway.frames import NO_WAYPOINT, Hello, State, Status
from noctule_gateway.log import LogState

_STATES: dict[int, UnitStatus.State] = {
    State.IDLE: UnitStatus.STATE_IDLE,
    State.SWEEPING: UnitStatus.STATE_SWEEPING,
    State.HOMING: UnitStatus.STATE_HOMING,
    State.WAITING: UnitStatus.STATE_WAITING,
    State.FAULT: UnitStatus.STATE_FAULT,
    State.PAUSING: UnitStatus.STATE_PAUSED,
}
_FAULTS = {1: "no home switch found within a turn: check the switch and the motor's wiring"}


@dataclass(frozen=True)
class Condition:
    """What is known of a unit at one moment; ``trouble`` is why it does not answer, empty while it does."""

    trouble: str
    hello: Hello | None
    status: Status | None
    log: LogState
    setup_error: str
    lost_pose: bool  # the last sweep had none


def detail(condition: Condition, unit: Unit) -> str:
    """The sentence for the operator; empty when all is well. It does not change while nothing changes."""
    if condition.trouble:
        return condition.trouble
    if condition.log.error:
        return condition.log.error
    if condition.setup_error:
        return condition.setup_error
    status = condition.status
    if status is not None and status.state == State.FAULT:
        return _FAULTS.get(status.fault, f"the unit reports fault {status.fault}")
    if status is not None and status.state == State.WAITING:
        return "the unit's ring is full: its sweeps are not acknowledged fast enough"
    return _lost_pose(unit) if condition.lost_pose else ""


def message(condition: Condition, unit: Unit) -> UnitStatus:
    """The status, but for what the gateway itself adds (site, time, clock, its own counters)."""
    hello, status, log = condition.hello, condition.status, condition.log
    result = UnitStatus(
        unit=unit.name,
        state=UnitStatus.STATE_DISCONNECTED,
        detail=detail(condition, unit),
        log_id=log.log_id,
        log_head=log.head,
        log_tail=log.tail,
        log_removed=log.removed,
    )
    if hello is not None:
        result.serial, result.firmware, result.boot = hello.serial, hello.version, hello.boot
    if status is not None:
        result.homed = status.homed
        if status.waypoint != NO_WAYPOINT:
            result.waypoint = status.waypoint
        if not condition.trouble:
            result.state = _STATES.get(status.state, UnitStatus.STATE_UNSPECIFIED)
    return result


def unit_counters(status: Status) -> dict[str, int]:
    """What the unit itself counts, under the names of the bus."""
    return {
        "unit_ring_used_bytes": status.ring_used,
        "unit_sweeps_waiting": status.sweeps_waiting,
        "unit_sweeps_made": status.sweeps_made,
        "unit_sweeps_resent": status.sweeps_resent,
        "unit_frames_bad": status.frames_bad,
        "unit_frames_unknown": status.frames_unknown,
        "unit_bytes_lost": status.bytes_lost,
        "unit_echo_faults": status.echo_faults,
    }


def _lost_pose(unit: Unit) -> str:
    match unit.pose:
        case WaypointPath(poses):
            return f"the last sweep has no pose: the unit's waypoint is not one of the path's 0 to {len(poses) - 1}"
        case PoseKey():
            return "the last sweep has no pose: nobody had published one on the unit's pose key"
    return ""
