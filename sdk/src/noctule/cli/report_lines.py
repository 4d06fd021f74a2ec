"""What ``unit-report`` prints: all that is known of a unit, and how it is asked for."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import groupby

from noctule.cli import replies
from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import CommandReply, CommandRequest, Measurement, UnitStatus
from noctule.unit_summary import UnitSummary

_TIMEOUT_S = 10.0
_NOT_MEASURED = "nothing since its gateway began: noctule rpc SITE UNIT self_test"


def summary_of(client: Client, unit: str, count: int) -> UnitSummary:
    """Ask the unit's gateway, for its last ``count`` sweeps too. Raises BusError, NotServedError."""
    told = client.command(unit, "status", CommandRequest(), _TIMEOUT_S)
    status: UnitStatus = told.status
    settings, why = None, ""
    try:
        reply: CommandReply = client.command(unit, "settings", CommandRequest(), _TIMEOUT_S)
        settings, why = (reply.settings, "") if reply.HasField("settings") else (None, reply.error)
    except BusError as error:
        why = str(error)
    first = max(status.log_head - count + 1, 1)
    records = client.log(unit, first, max=max(count, 1)) if count and status.log_head else None
    swept = list(records.sweeps) if records is not None else []
    return UnitSummary(status, settings, why, swept, list(told.measurements))


def report_lines(site: str, summary: UnitSummary) -> list[str]:
    """The report as text; not yet plain (see noctule.plain_text)."""
    status = summary.status
    known = CommandReply(status=status, settings=summary.settings)
    now = datetime.now(UTC)
    lines = [f"Unit {status.unit} of site {site}, {now:%Y-%m-%d %H:%M:%S} UTC", ""]
    lines += replies.lines(status.unit, "status", known)
    lines += ["", f"{status.unit}: its health", *summary.health_lines(), ""]
    if summary.settings is not None:
        lines += replies.lines(status.unit, "settings", known)
    else:
        lines.append(f"{status.unit}: its settings are not known: {summary.settings_error}")
    lines += ["", f"{status.unit}: what it has measured of itself"]
    lines += _measured(summary.measurements)
    return [*lines, "", f"{status.unit}: its last sweeps", *summary.sweep_lines()]


def _measured(found: Sequence[Measurement]) -> Iterator[str]:
    """The figures, under the minute in which they were measured."""
    if not found:
        yield f"  {_NOT_MEASURED}"
    for minute, group in groupby(found, lambda each: f"{each.time.ToDatetime():%Y-%m-%d %H:%M} UTC"):
        yield f"  {minute}"
        yield from replies.measurements(group)
