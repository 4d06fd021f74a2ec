"""What the bus is told of a unit: its state, a sentence for the operator when something is wrong, the counters."""

from noctule.faults import sentence
from noctule.messages_pb2 import UnitStatus
from noctule.site import PoseKey, Unit, WaypointPath
from noctule_gateway.status import reset_causes
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.wire.frames import NO_SLIP, NO_WAYPOINT, Loader, State, Status, Stay
from noctule_gateway.wire.sweep_message import bearing_rad, celsius

_STATES: dict[int, UnitStatus.State] = {
    State.IDLE: UnitStatus.STATE_IDLE,
    State.SWEEPING: UnitStatus.STATE_SWEEPING,
    State.HOMING: UnitStatus.STATE_HOMING,
    State.WAITING: UnitStatus.STATE_WAITING,
    State.FAULT: UnitStatus.STATE_FAULT,
    State.PAUSING: UnitStatus.STATE_PAUSED,
    State.TURNING: UnitStatus.STATE_TURNING,
    State.MEASURING: UnitStatus.STATE_MEASURING,
}
_FAULTS = {
    1: "no home switch found within a turn: check the switch and the motor's wiring",
    2: "the home switch does not open: check whether it sticks or its wire is grounded, and the motor's wiring",
}
_STAYS: dict[int, str] = {
    Stay.ASKED: "an update of its firmware was begun and not ended (it leaves by itself after a minute, if it can)",
    Stay.NO_APPLICATION: "it has no sound firmware to run",
    Stay.NOT_CONFIRMED: "its new firmware was started again and again and never answered a host",
    Stay.FLASH_FAILED: "its flash does not hold its firmware (replace the unit if it stays so)",
}
_LATE = "the gateway serves it late: the machine has too many units, or too slow a disk (counter late_ms)"
_BAD_LINE = "much of what it sends can't be read: check cable, ground and adapter (counters frames_bad)"


def detail(known: UnitState, unit: Unit) -> str:
    """The sentence for the operator; empty when all is well. It does not change while nothing changes."""
    by_urgency = (
        known.update,
        known.trouble,
        known.log.error,
        known.setup_error,
        _state_detail(known),
        "; ".join(map(sentence, known.faults)),
        _LATE if known.late else "",
        _BAD_LINE if known.bad_line else "",
        _lost_pose(unit) if known.lost_pose else "",
        known.out_of_turn,
        known.log.damage,
    )
    return next(filter(None, by_urgency), "")


def _state_detail(known: UnitState) -> str:
    """What keeps the unit from sweeping, as it says itself; empty if nothing does."""
    status = known.status
    if status is not None and status.state == State.FAULT:
        return _FAULTS.get(status.fault, f"the unit reports fault {status.fault}")
    if status is not None and status.state == State.WAITING:
        return _waiting(known)
    return ""


def message(known: UnitState, unit: Unit) -> UnitStatus:
    """The status, but for what the gateway itself adds (site, time, clock, its own counters)."""
    hello, status, log = known.hello, known.status, known.log
    result = UnitStatus(
        unit=unit.name,
        state=UnitStatus.STATE_DISCONNECTED,
        detail=detail(known, unit),
        log_id=log.log_id,
        log_head=log.head,
        log_tail=log.tail,
        log_removed=log.removed,
        log_damaged=log.damaged,
        faults=known.faults,
    )
    if known.loader is not None or known.update:
        result.state = UnitStatus.STATE_LOADER
    if known.loader is not None:
        result.serial = known.loader.serial
    elif hello is not None:
        result.reset_cause = reset_causes.cause(hello)
        result.serial, result.firmware, result.boot = hello.serial, hello.version, hello.boot
    if known.mechanics is not None and known.mechanics.slip != NO_SLIP:
        result.slip_rad = bearing_rad(known.mechanics.slip)
    if status is not None:
        result.homed = status.homed
        temperature_c = celsius(status.temperature)
        if temperature_c is not None:
            result.chip_temperature_c = temperature_c
        if status.waypoint != NO_WAYPOINT:
            result.waypoint = status.waypoint
        if not known.trouble:
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
        "unit_stack_free_bytes": status.stack_free,
        "unit_in_turn": int(status.in_turn),
    }


def in_loader(loader: Loader, unit: Unit, site: str) -> str:
    """The sentence for the operator of a unit that sits in its loader."""
    why = _STAYS.get(loader.reason, f"it says so for reason {loader.reason}")
    return f"in its loader, for {why}: update it by noctule rpc {site} {unit.name} update --image FILE"


def _waiting(known: UnitState) -> str:
    if known.late:
        return f"the unit's ring is full, and {_LATE}"
    if known.bad_line:
        return f"the unit's ring is full, and {_BAD_LINE}"
    return "the unit's ring is full: its sweeps come faster than the line carries them or the disk takes them"


def _lost_pose(unit: Unit) -> str:
    match unit.pose:
        case WaypointPath(poses):
            return f"the last sweep has no pose: the unit's waypoint is not one of the path's 0 to {len(poses) - 1}"
        case PoseKey():
            return "the last sweep has no pose: nobody had published one on the unit's pose key"
    return ""
