"""The commands that show a site: its units now, and what comes by."""

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from json import dumps
from pathlib import Path
from typing import Annotated, TypeVar

import typer
from google.protobuf.message import Message
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from noctule import awake, keys, poses, survey, unit_list
from noctule.cli.joining import DEFAULT_CONNECT, Connect, SiteName, Tls, joined, joined_until, nothing_found
from noctule.cli.replies import state
from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import Contour, ServiceStatus, Sweep, UnitStatus
from noctule.plain_text import plain
from noctule.site import Site, load
from noctule.unit_list import UnitRow

M = TypeVar("M", bound=Message)
_WIDEST = 1000
_LOOK_EVERY_S = 1.0
_UNWELL = frozenset({UnitStatus.STATE_UNSPECIFIED, UnitStatus.STATE_DISCONNECTED, UnitStatus.STATE_FAULT})


def units(
    site: Annotated[str, typer.Argument(metavar="SITE|SITE.toml", help="The site's name, or its site file.")],
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    json: Annotated[bool, typer.Option("--json", help="JSON lines: {unit, served, since, detail, status}.")] = False,
    goes_on: Annotated[
        bool, typer.Option("--watch", help="On a terminal: show it each second, units in trouble first, until Ctrl-C.")
    ] = False,
) -> None:
    """Show a site's units: which gateway serves them, in which state and since when, how long their logs are.

    With the site file, its units that are missing are shown too; without, those that a service has read before. Below
    them are the site's services: gateways, mappers, viewers.
    """
    if goes_on and (json or not sys.stdout.isatty()):
        raise typer.BadParameter(
            "needs a terminal: noctule watch SITE prints what comes as lines", param_hint="--watch"
        )
    file = load(Path(site)) if site.endswith(".toml") else None
    name = site if file is None else file.name
    with joined(name, connect, tls) as client, ThreadPoolExecutor() as pool:
        seen = _Seen.of(client, file, pool)
        if not seen.rows:
            raise BusError(f"site {name!r} has no units on the bus: is its gateway up?{nothing_found(client, tls)}")
        if json:
            for row in seen.rows:
                typer.echo(_json(row))
        elif goes_on:
            with awake.told_to_end() as over, Live(seen.unwell_first().shown(), auto_refresh=False) as live:
                while not over.wait(_LOOK_EVERY_S):
                    live.update(_Seen.of(client, file, pool).unwell_first().shown(), refresh=True)
        else:
            # A reader that is no terminal gets whole lines.
            Console(width=None if sys.stdout.isatty() else _WIDEST).print(seen.shown())


@dataclass(frozen=True)
class _Seen:
    """A site's units and services, at one moment."""

    rows: list[UnitRow]
    services: list[ServiceStatus]

    @classmethod
    def of(cls, client: Client, file: Site | None, pool: ThreadPoolExecutor) -> "_Seen":
        """Ask all at once, because a gateway that hangs lets each question run out of time."""
        alive = client.units()
        statuses, services = pool.submit(_told, client.unit_statuses), pool.submit(_told, client.service_statuses)
        told = sorted(services.result(), key=lambda service: (service.role, service.name))
        return cls(unit_list.rows(alive, statuses.result(), told, file), told)

    def unwell_first(self) -> "_Seen":
        """A terminal that is too small cuts off the end."""
        return _Seen(sorted(self.rows, key=_is_well), self.services)

    def shown(self) -> Group:
        """The table of units, and that of services where there are any."""
        return Group(_table(self.rows), *([_service_table(self.services)] if self.services else []))


def watch(
    site: SiteName,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    json: Annotated[bool, typer.Option("--json", help="JSON lines: {key, message, value}.")] = False,
) -> None:
    """Show sweeps, statuses and contours as they come, until Ctrl-C or until nobody reads them."""
    nobody_reads = threading.Event()
    with awake.told_to_end() as over, joined_until(over, site, connect, tls) as client:
        if client is None:
            return

        def show(key: str, message: Message) -> None:
            try:
                (_show_json if json else _show_line)(key, message)
            except BrokenPipeError:
                nobody_reads.set()
                over.set()

        if not client.units():
            typer.echo(f"nobody serves a unit of site {site!r} yet.{nothing_found(client, tls)}", err=True)
        client.on_sweep(lambda sweep: show(keys.sweep(site, sweep.unit), sweep))
        client.on_unit_status(lambda status: show(keys.unit_status(site, status.unit), status))
        client.on_contour(lambda contour: show(keys.contour(site), contour))
        awake.wait(over)
    if nobody_reads.is_set():
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains of the pipe as it ends


def _told(ask: Callable[[], list[M]]) -> list[M]:
    """What was replied; nothing where the only one who could reply hangs, which its row shows."""
    try:
        return ask()
    except BusError:
        return []


def _is_well(row: UnitRow) -> bool:
    return row.status is not None and row.status.state not in _UNWELL and not row.status.faults


def _table(rows: list[UnitRow]) -> Table:
    table = Table("unit", "gateway", "state", "since", "log", "firmware", "serial", "boot", "clock error", "detail")
    for row in rows:
        gateway, *others = _cells(row)
        style = "" if _is_well(row) else "red"
        cells = [Text(plain(cell), style=style) for cell in (row.unit, gateway, *others, row.detail)]
        table.add_row(*cells)
    return table


def _service_table(services: list[ServiceStatus]) -> Table:
    table = Table("service", "role", "version", "detail")
    for each in services:
        table.add_row(*(Text(plain(cell)) for cell in (each.name, each.role, each.version, each.detail)))
    return table


def _json(row: UnitRow) -> str:
    since = "null" if row.since_ns is None else f'"{datetime.fromtimestamp(row.since_ns / 1e9, UTC).isoformat()}"'
    status = "null" if row.status is None else survey.to_json(row.status)
    head = dumps({"unit": row.unit, "served": row.served, "detail": row.detail})
    return f'{head[:-1]}, "since": {since}, "status": {status}}}'


def _cells(row: UnitRow) -> list[str]:
    since = "" if row.since_ns is None else f"{datetime.fromtimestamp(row.since_ns // 10**9):%Y-%m-%d %H:%M:%S}"
    status = row.status
    if status is None:
        return ["?" if row.served else "none", "?" if row.served else "not served", since, *[""] * 5]
    log = f"{status.log_tail}-{status.log_head}" if status.log_head else "empty"
    shown = [status.gateway, state(status), since, log]
    if not status.firmware:
        return [*shown, "", str(status.serial or ""), "", ""]  # it has not said HELLO to this gateway yet
    return [*shown, status.firmware, str(status.serial), str(status.boot), f"{status.clock_error_s * 1e3:.2f} ms"]


def _show_json(key: str, message: Message) -> None:
    value = survey.to_json(message)
    typer.echo(f'{{"key": "{key}", "message": "{message.DESCRIPTOR.full_name}", "value": {value}}}')


def _show_line(_key: str, message: Message) -> None:
    match message:
        case Sweep():
            typer.echo(_sweep_line(message))
        case UnitStatus():
            told = f"{message.unit:<8} {state(message)}, log at {message.log_head} {message.detail}"
            typer.echo(plain(told.rstrip()))
        case Contour():
            typer.echo(_contour_line(message))
            for pose in poses.remarkable(message):
                typer.echo(plain(f"{pose.unit:<8} {poses.words(pose)}"))


def _sweep_line(sweep: Sweep) -> str:
    echoes = sum(reading.HasField("time_of_flight_s") for reading in sweep.readings)
    where = f" at ({sweep.pose.x_m:.2f}, {sweep.pose.y_m:.2f}) m" if sweep.HasField("pose") else ""
    return f"{sweep.unit:<8} sweep {sweep.log_sequence}: {echoes} echoes of {len(sweep.readings)} readings{where}"


def _contour_line(contour: Contour) -> str:
    one_place = (
        f" ({guessed} from one place)" if (guessed := sum(wall.HasField("chance") for wall in contour.walls)) else ""
    )
    touches = f", {len(contour.touches)} touches" if contour.touches else ""
    return (
        f"{'contour':<8} {contour.version}: {len(contour.walls)} walls{one_place}, {len(contour.cylinders)} cylinders"
        f"{touches}, {contour.sweeps} sweeps"
    )
