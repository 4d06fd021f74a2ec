"""What ``units`` shows: a site's units and services now, as tables or as JSON lines."""

import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from json import dumps
from pathlib import Path
from typing import TypeVar

import typer
from google.protobuf.message import Message
from rich.cells import cell_len
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from noctule import awake, survey, unit_list
from noctule.ages import age
from noctule.cli.joining import joined, nothing_found
from noctule.cli.replies import state
from noctule.client import Client
from noctule.errors import BusError, SilenceError
from noctule.messages_pb2 import ServiceStatus
from noctule.plain_text import plain
from noctule.site import Site, load
from noctule.unit_list import UnitRow

M = TypeVar("M", bound=Message)
_WIDEST = 1000
_COLUMNS: tuple[str, ...] = (
    "unit",
    "gateway",
    "state",
    "since",
    "last sweep",
    "log",
    "firmware",
    "serial",
    "boot",
    "clock error",
    "detail",
)
_NEEDED_LEAST: tuple[str, ...] = ("boot", "serial", "clock error", "firmware", "log", "gateway", "since", "last sweep")
_LEAST_DETAIL = 23
_LOOK_EVERY_S = 1.0


def show_site(site: str, connect: list[str], tls: Path | None, json: bool, goes_on: bool) -> None:
    """Show the ``site`` of that name or file; with ``goes_on`` until Ctrl-C. Raises BusError where it has no unit."""
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
            console = Console()
            first = seen.unwell_first().shown(console.width)
            with awake.told_to_end() as over, Live(first, console=console, auto_refresh=False) as live:
                while not over.wait(_LOOK_EVERY_S):
                    with suppress(SilenceError):  # what was seen last stands
                        live.update(_Seen.of(client, file, pool).unwell_first().shown(console.width), refresh=True)
        else:
            # A reader that is no terminal gets whole lines.
            console = Console(width=None if sys.stdout.isatty() else _WIDEST)
            console.print(seen.shown(console.width))


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
        return _Seen(sorted(self.rows, key=unit_list.is_well), self.services)

    def shown(self, width: int) -> Group:
        """The table of units, and that of services where there are any, in ``width`` columns of a terminal."""
        return Group(*_unit_table(self.rows, width), *([_service_table(self.services)] if self.services else []))


def _told(ask: Callable[[], list[M]]) -> list[M]:
    """What was replied; nothing where the only one who could reply hangs, which its row shows."""
    try:
        return ask()
    except BusError:
        return []


def _unit_table(rows: list[UnitRow], width: int) -> list[Table | str]:
    """The table, and a line that names the columns for which ``width`` has no room: words are not cut."""
    cells = [dict(zip(_COLUMNS, map(plain, (row.unit, *_cells(row), row.detail)), strict=True)) for row in rows]
    columns = fitting(cells, width)
    table = Table()
    for column in columns:
        table.add_column(column, no_wrap=column != _COLUMNS[-1], overflow="fold")
    for row, words in zip(rows, cells, strict=True):
        style = "" if unit_list.is_well(row) else "red"
        table.add_row(*(Text(words[column], style=style) for column in columns))
    missing = [column for column in _COLUMNS if column not in columns]
    return [table, f"A wider terminal, or --json, shows also: {', '.join(missing)}"] if missing else [table]


def fitting(cells: list[dict[str, str]], width: int) -> list[str]:
    """The columns of _COLUMNS whose whole words ``width`` has room for, those that are needed least left out first.

    ``cells`` are the words of each row by column. The last column may be broken into lines.
    """
    widths = {column: 3 + max(cell_len(column), *(cell_len(row[column]) for row in cells)) for column in _COLUMNS}
    widths[_COLUMNS[-1]] = min(widths[_COLUMNS[-1]], 3 + _LEAST_DETAIL)
    for column in _NEEDED_LEAST:
        if 1 + sum(widths.values()) <= width:
            break
        del widths[column]
    return list(widths)


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
    swept = "" if row.swept_ns is None else age(time.time() - row.swept_ns / 1e9)
    status = row.status
    if status is None:
        return ["?" if row.served else "none", "?" if row.served else "not served", since, swept, *[""] * 5]
    log = f"{status.log_tail}-{status.log_head}" if status.log_head else "empty"
    shown = [status.gateway, state(status), since, swept, log]
    if not status.firmware:
        return [*shown, "", str(status.serial or ""), "", ""]  # it has not said HELLO to this gateway yet
    return [*shown, status.firmware, str(status.serial), str(status.boot), f"{status.clock_error_s * 1e3:.2f} ms"]
