"""The command noctule-viewer: ``run`` is the relay between mappers and those who watch, ``open`` shows the map."""

import logging
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, NoReturn
from urllib.parse import urlsplit

import typer

from noctule import logs, tls
from noctule.ending import Ending
from noctule.endpoints import LAST_PORT
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.version_option import version_option
from noctule_viewer import memory_limit as memory_limits
from noctule_viewer import rerun_versions
from noctule_viewer.recordings import days
from noctule_viewer.relay import RERUN, Relay, environment

_log = logging.getLogger(__name__)
app = typer.Typer(no_args_is_help=True, pretty_exceptions_enable=False)

_RELAY_SCHEMES = ("rerun+http://", "rerun+https://", "rerun://")
_DEFAULT = Relay(bind="127.0.0.1", port=9876, web_port=9090, memory_limit=memory_limits.DEFAULT)


@app.callback()
def main(_version: Annotated[bool, version_option("noctule-viewer")] = False) -> None:
    """The Rerun relay and the layout of the viewer."""


@app.command()
def run(
    bind: Annotated[
        str, typer.Option(help="Address to listen on. The relay has no passwords: keep it on loopback.")
    ] = (_DEFAULT.bind),
    port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port for mappers and native viewers.")
    ] = _DEFAULT.port,
    web_port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port of the page for browsers.")
    ] = _DEFAULT.web_port,
    memory_limit: Annotated[
        str, typer.Option(help="How much history to keep for viewers that come later; it costs 2.3 times as much.")
    ] = _DEFAULT.memory_limit,
    site: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|FILE",
            help="Watch this site on the bus: alarms and a table of its units, beside the map. "
            "From its site file, if you give that, the map also has the planned paths of carried units. "
            "Give several for a tab each; their mappers then need --rerun ADDRESS#sites.",
        ),
    ] = None,
    floor_plan: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SITE=]FILE",
            help="With --site: a drawing under the map, DXF or GeoJSON; SITE= if there are several.",
        ),
    ] = None,
    floor_plan_at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[SITE=]X,Y,DEGREES[,SCALE]",
            help="Where the drawing's origin lies on the map, in metres, how far it is turned anticlockwise, "
            "and how many metres its unit is (default: as the drawing says).",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", help="With --site: a router; give more for a fallback.")
    ] = None,
    tls_folder: Annotated[
        Path | None,
        typer.Option(
            "--tls",
            envvar=tls.FOLDER_VARIABLE,
            metavar="FOLDER",
            help="With --site: certificate and key, a folder that noctule-deploy render made.",
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Record what is shown, by days, and show the past hours after a restart.",
        ),
    ] = None,
    keep_days: Annotated[
        int, typer.Option(min=1, help="With --record: delete all but so many of the days that were recorded last.")
    ] = 7,
    metrics: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Serve Prometheus metrics here.")] = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Run the relay and print the address to open."""
    logs.set_up(log_format)
    ending = Ending()

    def announce() -> None:
        if log_format is LogFormat.JSON:
            _log.info("Watch the map at %s", relay.page)
        else:
            print(f"Watch the map at {relay.page}", flush=True)

    if (floor_plan or floor_plan_at) and not site:
        _fail("a floor plan belongs to a site: give --site too", 2)
    from noctule_viewer.board.site_plan import read  # Numpy and Zenoh take a while to import
    from noctule_viewer.serve import Recorded, Watched, serve

    try:
        relay = Relay(bind, port, web_port, memory_limits.checked(memory_limit))
        relay.check_ports()
        watched = (
            Watched(read(site, floor_plan or [], floor_plan_at or []), connect or [], tls_folder) if site else None
        )
        recorded = Recorded(record, keep_days) if record else None
        status = serve(relay, announce, watched, recorded, metrics, ending)
    except NoctuleError as error:
        logs.log_lines(_log, error)
        raise typer.Exit(1) from error
    _log.error("the relay ended by itself, with status %d", status)
    raise typer.Exit(status if status > 0 else 128 - status)


@app.command(name="open")
def open_(
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[FILE.rrd ...|FOLDER]", help="Recordings in place of the relay, or the folder of a recorder."
        ),
    ] = None,
    day: Annotated[
        str | None, typer.Option(metavar="YYYY-MM-DD", help="Of a folder: this day, in place of the last.")
    ] = None,
    url: Annotated[str, typer.Option(help="The relay, as printed by the mapper's --rerun.")] = _DEFAULT.url,
    web_port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port of the relay's page, which is asked for its version.")
    ] = _DEFAULT.web_port,
) -> None:
    """Open the native viewer, or, where there is no screen, print the address for a browser.

    A relay with another version of Rerun is named first.
    """
    if not url.startswith(_RELAY_SCHEMES):
        _fail(f"{url} is no relay: give {_DEFAULT.url}, with your relay's host and port")
    try:
        files = _files(recordings or [], day)
    except NoctuleError as error:
        _fail(str(error))
    if not files and (differs := _differs(url, web_port)):
        print(f"noctule-viewer: {differs}", file=sys.stderr)
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        print(_without_screen(files, url))
        return
    shown = [str(file.resolve()) for file in files] or [url]
    os.execve(RERUN, [str(RERUN), *shown, "--bind", "127.0.0.1", "--port", "0"], environment())


@app.command(name="days")
def days_(
    folder: Annotated[Path, typer.Argument(help="Where noctule-viewer run --record has recorded.")],
) -> None:
    """List the days that were recorded, and how large they are."""
    try:
        found = days.recorded(folder)
    except NoctuleError as error:
        _fail(str(error))
    for day in found:
        print(f"{day.name} {day.size_bytes / 1e6:8.1f} MB")


def _files(recordings: Sequence[Path], day: str | None) -> list[Path]:
    """The files to open, none for the relay. Raises RecordingsError."""
    if len(recordings) == 1 and recordings[0].is_dir():
        return list(days.chosen(recordings[0], day).files)
    if day is not None:
        raise days.RecordingsError("--day needs the folder that noctule-viewer run --record writes to")
    for each in recordings:
        if not each.is_file():
            raise days.RecordingsError(f"there is no file {each}: give a recording, or a folder of them")
    return list(recordings)


def _differs(url: str, web_port: int) -> str:
    """What is to be said of the relay's version; empty where nothing is."""
    host = urlsplit(url).hostname or _DEFAULT.bind
    return rerun_versions.of_native_viewer(version("rerun-sdk"), rerun_versions.ask(host, web_port))


def _without_screen(recordings: Sequence[Path], url: str) -> str:
    if recordings:
        files, names = " ".join(map(str, recordings)), " ".join(file.name for file in recordings)
        return f"There is no screen here. Copy {files} to where there is one: noctule-viewer open {names}"
    return f"There is no screen here. Connect a Rerun viewer to {url}, or open {_DEFAULT.page} in a browser."


def _fail(message: str, status: int = 1) -> NoReturn:
    print(f"noctule-viewer: {message}", file=sys.stderr)
    raise typer.Exit(status)
