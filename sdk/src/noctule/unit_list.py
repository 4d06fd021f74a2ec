"""The units of a site as an operator wants to see them: one row for each gateway that serves one, or one without."""

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

from noctule.messages_pb2 import Cursor, ServiceStatus, UnitStatus
from noctule.site import Site

NO_STATUS = "its gateway gives no status: it hangs, or has just been started"
NO_GATEWAY = "no gateway serves it"
_UNWELL = frozenset(
    {
        UnitStatus.STATE_UNSPECIFIED,
        UnitStatus.STATE_DISCONNECTED,
        UnitStatus.STATE_WAITING,
        UnitStatus.STATE_FAULT,
        UnitStatus.STATE_LOADER,
    }
)


@dataclass(frozen=True)
class UnitRow:
    """One unit, as the gateway of ``status`` knows it; without one, what others know of the unit.

    ``since_ns`` (UTC) is since when the unit has answered its gateway or has not, or, where no gateway serves it, when
    its last sweep was made; None if nobody knows. ``swept_ns`` (UTC) is when its last sweep was logged, or, where the
    gateway has logged none since it started, when the last one that a service has read was made.
    """

    unit: str
    served: bool
    status: UnitStatus | None
    since_ns: int | None
    swept_ns: int | None
    detail: str


def rows(
    alive: Collection[str], statuses: Iterable[UnitStatus], services: Iterable[ServiceStatus], site: Site | None
) -> list[UnitRow]:
    """All units in the order of their names: those on the bus, of the site file, or read by a service before.

    ``alive`` are the units that a gateway serves; ``site`` is None where no site file was given.
    """
    by_unit: dict[str, list[UnitStatus]] = {}
    for status in sorted(statuses, key=lambda each: each.gateway):
        by_unit.setdefault(status.unit, []).append(status)
    read = _read_last(services)
    named = {unit.name for unit in site.units} if site else None
    result: list[UnitRow] = []
    for name in sorted({*alive, *by_unit, *read, *(named or ())}, key=natural):
        stranger = "not in the site file" if named is not None and name not in named else ""
        found = [_with_status(status, read.get(name)) for status in by_unit.get(name, [])]
        if not found:
            found = [_without_status(name, name in alive, read.get(name), bool(named) and not stranger)]
        result += [_and_told(row, stranger) for row in found]
    return result


def is_well(row: UnitRow) -> bool:
    """Its gateway says that it works, and has nothing to tell about it: nobody needs to look."""
    status = row.status
    return status is not None and status.state not in _UNWELL and not status.faults and not row.detail


def natural(name: str) -> list[str | int]:
    """u2 before u10."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


@dataclass(frozen=True)
class _Read:
    service: str
    cursor: Cursor


def _read_last(services: Iterable[ServiceStatus]) -> dict[str, _Read]:
    """By unit, the newest sweep that a service has read."""
    found: dict[str, _Read] = {}
    for service in services:
        for cursor in service.cursors:
            known = found.get(cursor.unit)
            if cursor.unit and (known is None or _made(cursor) > _made(known.cursor)):
                found[cursor.unit] = _Read(service.name, cursor)
    return found


def _made(cursor: Cursor) -> tuple[int, int]:
    return cursor.time.ToNanoseconds(), cursor.log_sequence


def _with_status(status: UnitStatus, read: _Read | None) -> UnitRow:
    since_ns = status.since.ToNanoseconds() if status.HasField("since") else None
    swept_ns = status.last_sweep.ToNanoseconds() if status.HasField("last_sweep") else _read_ns(read)
    return UnitRow(status.unit, True, status, since_ns, swept_ns, status.detail)


def _read_ns(read: _Read | None) -> int | None:
    return read.cursor.time.ToNanoseconds() if read and read.cursor.HasField("time") else None


def _without_status(name: str, served: bool, read: _Read | None, in_site_file: bool) -> UnitRow:
    swept_ns = _read_ns(read)
    if served:
        return UnitRow(name, True, None, None, swept_ns, NO_STATUS)
    told = NO_GATEWAY if in_site_file else f"{NO_GATEWAY} any more"
    if read is not None:
        told += f"; {read.service} has read its log to {read.cursor.log_sequence}"
    return UnitRow(name, False, None, swept_ns, swept_ns, told)


def _and_told(row: UnitRow, more: str) -> UnitRow:
    detail = "; ".join(filter(None, (more, row.detail)))
    return replace(row, detail=detail)
