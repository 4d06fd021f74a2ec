"""The commands that show a site: its units now, and what comes by."""

import os
import sys
import threading
from contextlib import suppress
from typing import Annotated

import typer
from google.protobuf.message import Message
from rich.console import Console
from rich.table import Table

from noctule import keys, poses, survey
from noctule.cli.joining import DEFAULT_CONNECT, Connect, SiteName, Tls, joined, may_read
from noctule.messages_pb2 import Contour, Sweep, UnitStatus


def units(site: SiteName, connect: Connect = DEFAULT_CONNECT, tls: Tls = None) -> None:
    """Show a site's units: who is alive, in which state, how long its log is, how good its clock."""
    with joined(site, connect, tls) as client:
        alive = client.units()
        statuses = {status.unit: status for status in client.unit_statuses()}
    table = Table("unit", "alive", "state", "firmware", "serial", "boot", "log", "clock error", "detail")
    for name in sorted(alive | statuses.keys()):
        table.add_row(name, "yes" if name in alive else "no", *_status_cells(statuses.get(name)))
    Console().print(
        table if table.rows else f"site {site!r} has no units on the bus: is its gateway up?{may_read(tls)}"
    )


def watch(
    site: SiteName,
    connect: Connect = DEFAULT_CONNECT,
    tls: Tls = None,
    json: Annotated[bool, typer.Option("--json", help="JSON lines: {key, message, value}.")] = False,
) -> None:
    """Show sweeps, statuses and contours as they come, until Ctrl-C or until nobody reads them."""
    over = threading.Event()

    def show(key: str, message: Message) -> None:
        try:
            (_show_json if json else _show_line)(key, message)
        except BrokenPipeError:
            over.set()

    with suppress(KeyboardInterrupt), joined(site, connect, tls, patience_s=None) as client:
        client.on_sweep(lambda sweep: show(keys.sweep(site, sweep.unit), sweep))
        client.on_unit_status(lambda status: show(keys.unit_status(site, status.unit), status))
        client.on_contour(lambda contour: show(keys.contour(site), contour))
        over.wait()
    if over.is_set():
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains of the pipe as it ends


def _status_cells(status: UnitStatus | None) -> list[str]:
    if status is None:
        return ["?"] * 6 + ["its gateway gives no status"]
    return [
        _state(status),
        status.firmware,
        str(status.serial),
        str(status.boot),
        f"{status.log_tail}-{status.log_head}" if status.log_head else "empty",
        f"{status.clock_error_s * 1e3:.2f} ms",
        status.detail,
    ]


def _show_json(key: str, message: Message) -> None:
    value = survey.to_json(message)
    typer.echo(f'{{"key": "{key}", "message": "{message.DESCRIPTOR.full_name}", "value": {value}}}')


def _show_line(_key: str, message: Message) -> None:
    match message:
        case Sweep():
            typer.echo(_sweep_line(message))
        case UnitStatus():
            typer.echo(f"{message.unit:<8} {_state(message)}, log at {message.log_head} {message.detail}".rstrip())
        case Contour():
            typer.echo(_contour_line(message))
            for pose in poses.remarkable(message):
                typer.echo(f"{pose.unit:<8} {poses.words(pose)}")


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


def _state(status: UnitStatus) -> str:
    if status.state not in UnitStatus.State.values():
        return f"state {status.state} of a newer gateway"
    return UnitStatus.State.Name(status.state).removeprefix("STATE_").lower()
