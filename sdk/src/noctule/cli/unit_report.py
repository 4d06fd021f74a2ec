"""The command that prints all that is known of one unit, to be filed with it."""

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Annotated

import typer

from noctule.cli import replies
from noctule.cli.joining import DEFAULT_CONNECT, Connect, SiteName, Tls, UnitName, joined, nothing_found
from noctule.client import Client
from noctule.errors import BusError, NotServedError, ReportError
from noctule.messages_pb2 import CommandReply, CommandRequest, Measurement, UnitStatus
from noctule.plain_text import plain
from noctule.unit_summary import UnitSummary

_TIMEOUT_S = 10.0
_NOT_MEASURED = "nothing since its gateway began: noctule rpc SITE UNIT self_test"


def unit_report(
    site: SiteName,
    unit: UnitName,
    sweeps: Annotated[int, typer.Option(help="How many of its last sweeps are looked at.", min=0, max=500)] = 50,
    output: Annotated[Path | None, typer.Option(help="Write it into this file too.", dir_okay=False)] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object.")] = False,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
) -> None:
    """Print all that is known of a unit: versions, settings, counters, clock, health, and its sweeps by bearing."""
    with joined(site, connect, tls) as client:
        try:
            summary = _summary(client, unit, sweeps)
        except NotServedError as error:
            raise NotServedError(f"{error}.{nothing_found(client, tls)}") from error
    text = summary.to_json() if json else "\n".join(map(plain, _lines(site, summary)))
    typer.echo(text)
    if output is not None:
        try:
            output.write_text(text + "\n")
        except OSError as error:
            raise ReportError(f"{output} can't be written: {error.strerror}") from error


def _summary(client: Client, unit: str, count: int) -> UnitSummary:
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


def _lines(site: str, summary: UnitSummary) -> list[str]:
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
