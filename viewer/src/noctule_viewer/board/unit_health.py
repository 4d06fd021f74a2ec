"""Whether each unit is well, in words, and since when."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from math import tau

from noctule import unit_list
from noctule.ages import duration
from noctule.bounds import MAX_READINGS, UNIT_PLAN
from noctule.messages_pb2 import POSE_STATE_WRONG, UnitStatus
from noctule.site import PINGS
from noctule.unit_list import UnitRow
from noctule_viewer.board.site_state import Heard

SILENT_AFTER_S = 10.0  # statuses come each second
MOST_UNITS = 300  # strangers may name more; a table of so many takes 6 kB/s of the relay's history
# The longest sweep that a plan allows (firmware/README.md, CONFIGURE and CALIBRATE), some ten minutes: each reading
# with all its pings, the slowest ramp and the longest rest, and the slowest way from end to end and back. Only such a
# plan can take longer, where its pings wait for turns.
_END_TO_END_HALF_STEPS = 4400 * 2 * UNIT_PLAN["first_bearing_rad"].most / tau
_END_TO_END_S = _END_TO_END_HALF_STEPS / UNIT_PLAN["top_speed_half_steps_s"].least
_READING_S = PINGS[-1] * UNIT_PLAN["ping_interval_s"].most + UNIT_PLAN["ramp_s"].most + UNIT_PLAN["settle_s"].most
LONGEST_SWEEP_S = MAX_READINGS * _READING_S + 2 * _END_TO_END_S


class Health(Enum):
    """What an operator has to do about a unit."""

    WELL = "well"
    ATTENTION = "needs attention"
    AWAY = "away"  # nobody hears it


@dataclass(frozen=True)
class UnitHealth:
    """A unit as its row in the table has it. Times are UTC in seconds, None where they are not known."""

    unit: str
    health: Health
    words: str
    since_s: float | None
    swept_s: float | None
    status: UnitStatus | None


class UnitsHealth:
    """Remembers since when each unit's health has been as it is."""

    def __init__(self) -> None:
        self._since: dict[str, tuple[Health, float | None]] = {}

    def of(self, heard: Heard) -> list[UnitHealth]:
        """Every unit in the order of names, u2 before u10; a unit that two gateways serve as the worse one has it.

        Of more than MOST_UNITS those that a gateway serves come first.
        """
        rows = unit_list.rows(heard.alive, _statuses(heard), heard.services.values(), None)
        by_unit: dict[str, list[UnitRow]] = {}
        for row in rows:
            by_unit.setdefault(row.unit, []).append(row)
        kept = set(sorted(by_unit, key=lambda unit: unit not in heard.alive)[:MOST_UNITS])
        self._since = {unit: since for unit, since in self._since.items() if unit in kept}
        return [self._of(unit, by_unit[unit], heard) for unit in by_unit if unit in kept]

    def _of(self, unit: str, rows: Sequence[UnitRow], heard: Heard) -> UnitHealth:
        found = [(*_judged(row, heard), row) for row in rows]
        order = list(Health)
        health, words, row = max(found, key=lambda each: order.index(each[0]))
        since_s = self._noted(unit, health, row, heard.now_s)
        return UnitHealth(unit, health, words, since_s, heard.swept_s.get(unit), row.status)

    def _noted(self, unit: str, health: Health, row: UnitRow, now_s: float) -> float | None:
        """Since when its health is as it is: as the gateway says, else since the viewer has seen it change."""
        known = self._since.get(unit)
        if known is None or known[0] is not health:
            since_s = None if known is None else now_s
            faults = row.status.faults if health is Health.ATTENTION and row.status is not None else ()
            if faults:
                begun_ns = [fault.since.ToNanoseconds() for fault in faults if fault.HasField("since")]
                since_s = min(begun_ns) / 1e9 if len(begun_ns) == len(faults) else None
            elif row.since_ns and (health is Health.AWAY or (health is Health.WELL and known is None)):
                since_s = row.since_ns / 1e9
            self._since[unit] = health, since_s
        return self._since[unit][1]


def _statuses(heard: Heard) -> list[UnitStatus]:
    """Of each unit those of the gateways that still speak of it, or the one that did last."""
    last: dict[str, tuple[float, UnitStatus]] = {}
    fresh: dict[str, list[UnitStatus]] = {}
    for (unit, gateway), status in heard.units.items():
        silent_s = heard.unit_silent_s[unit, gateway]
        if silent_s <= SILENT_AFTER_S:
            fresh.setdefault(unit, []).append(status)
        if unit not in last or silent_s < last[unit][0]:
            last[unit] = silent_s, status
    return [status for unit, (_, newest) in last.items() for status in fresh.get(unit, [newest])]


def _judged(row: UnitRow, heard: Heard) -> tuple[Health, str]:
    status = row.status
    if status is None:
        return Health.AWAY, row.detail
    silent_s = heard.unit_silent_s[row.unit, status.gateway]
    if row.unit not in heard.alive:
        return Health.AWAY, unit_list.NO_GATEWAY
    if silent_s > SILENT_AFTER_S:
        return Health.AWAY, f"its gateway {status.gateway} has been silent for {duration(silent_s)}"
    name = UnitStatus.State.Name(status.state).removeprefix("STATE_").lower()
    told = f"{name}: {row.detail}" if row.detail else name
    if status.state == UnitStatus.STATE_DISCONNECTED:
        return Health.AWAY, told
    if (wrong := _wrong_pose(row.unit, heard) or _no_sweep(status, heard)) and not row.detail:
        return Health.ATTENTION, f"{name}: {wrong}"
    return (Health.WELL if unit_list.is_well(row) else Health.ATTENTION), told


def _wrong_pose(unit: str, heard: Heard) -> str:
    poses = heard.contour.poses if heard.contour is not None else []
    return next(("its stated pose is wrong" for p in poses if p.unit == unit and p.state == POSE_STATE_WRONG), "")


def _no_sweep(status: UnitStatus, heard: Heard) -> str:
    sweepless_s = heard.sweepless_s.get((status.unit, status.gateway), 0.0)
    return f"no sweep has come for {duration(sweepless_s)}" if sweepless_s > LONGEST_SWEEP_S else ""
