"""What ``watch`` shows: sweeps, statuses and contours as they come, a line each."""

import os
import sys
import threading
from pathlib import Path

import typer
from google.protobuf.message import Message

from noctule import awake, keys, poses, survey
from noctule.cli.joining import joined_until, nothing_found
from noctule.cli.replies import state
from noctule.errors import SilenceError
from noctule.messages_pb2 import Contour, Sweep, UnitStatus
from noctule.plain_text import plain


def show_passing(site: str, connect: list[str], tls: Path | None, json: bool) -> None:
    """Show them until Ctrl-C, or until nobody reads them."""
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

        try:
            if not client.units():
                typer.echo(f"nobody serves a unit of site {site!r} yet.{nothing_found(client, tls)}", err=True)
        except SilenceError as error:
            typer.echo(str(error), err=True)
        client.on_sweep(lambda sweep: show(keys.sweep(site, sweep.unit), sweep))
        client.on_unit_status(lambda status: show(keys.unit_status(site, status.unit), status))
        client.on_contour(lambda contour: show(keys.contour(site), contour))
        awake.wait(over)
    if nobody_reads.is_set():
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains of the pipe as it ends


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
