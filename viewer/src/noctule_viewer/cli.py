"""The command noctule-viewer: ``run`` is the relay between mappers and those who watch, ``open`` shows the map."""

import logging
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from noctule import logs, tls
from noctule.ending import Ending
from noctule.endpoints import LAST_PORT
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.version_option import version_option
from noctule_viewer import memory_limit as memory_limits
from noctule_viewer.relay import RERUN, Relay, environment

if TYPE_CHECKING:
    from noctule_viewer.board.site_plan import SitePlan

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
        str | None,
        typer.Option(
            metavar="NAME|FILE",
            help="Watch this site on the bus: alarms and a table of its units, beside the map. "
            "From its site file, if you give that, the map also has the planned paths of carried units.",
        ),
    ] = None,
    floor_plan: Annotated[
        Path | None, typer.Option(metavar="FILE", help="With --site: a drawing under the map, DXF or GeoJSON.")
    ] = None,
    floor_plan_at: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,DEGREES[,SCALE]",
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
    metrics: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Serve Prometheus metrics here.")] = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=logs.FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Run the relay and print the address to open."""
    logs.set_up(log_format)
    ending = Ending()

    @contextmanager
    def announced() -> Iterator[None]:
        if log_format is LogFormat.JSON:
            _log.info("Watch the map at %s", relay.page)
        else:
            print(f"Watch the map at {relay.page}", flush=True)
        yield

    try:
        relay = Relay(bind, port, web_port, memory_limits.checked(memory_limit))
        relay.check_ports()
        if site is None:
            if floor_plan is not None:
                _fail("a floor plan belongs to a site: give --site too", 2)
            status = relay.run(announced, metrics, ending)
        else:
            from noctule_viewer.board import site_plan  # Numpy takes a while to import, and only a site needs it

            plan = site_plan.read(site, floor_plan, floor_plan_at)
            status = _run_watching(plan, connect or [], tls_folder, relay, announced, metrics, ending)
    except NoctuleError as error:
        _log.error("%s", error)
        raise typer.Exit(1) from error
    _log.error("the relay ended by itself, with status %d", status)
    raise typer.Exit(status if status > 0 else 128 - status)


@app.command(name="open")
def open_(
    recording: Annotated[
        Path | None, typer.Argument(metavar="[FILE.rrd]", help="A recording in place of the relay.")
    ] = None,
    url: Annotated[str, typer.Option(help="The relay, as printed by the mapper's --rerun.")] = _DEFAULT.url,
) -> None:
    """Open the native viewer, or, where there is no screen, print the address for a browser."""
    if not url.startswith(_RELAY_SCHEMES):
        _fail(f"{url} is no relay: give {_DEFAULT.url}, with your relay's host and port")
    if recording and not recording.is_file():
        _fail(f"there is no file {recording}: give a recording, as noctule-mapper fit --rrd writes it")
    if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        print(_without_screen(recording, url))
        return
    shown = str(recording.resolve()) if recording else url
    os.execve(RERUN, [str(RERUN), shown, "--bind", "127.0.0.1", "--port", "0"], environment())


def _run_watching(
    plan: "SitePlan",
    connect: Sequence[str],
    tls_folder: Path | None,
    relay: Relay,
    announced: Callable[[], AbstractContextManager[object]],
    metrics: str | None,
    ending: Ending,
) -> int:
    """Run the relay on the bus of a site, with a board of how it fares. Returns the relay's exit status."""
    from noctule_viewer.board.board import Board  # Rerun's SDK takes a second to import, and only this needs it
    from noctule_viewer.board.site_state import SiteState
    from noctule_viewer.presence import Presence

    state = SiteState()

    @contextmanager
    def shown() -> Iterator[None]:
        with announced(), Board(relay.url, plan, state):
            yield

    with Presence(plan.site, state, connect, tls_folder) as presence:
        return relay.run(shown, metrics, ending, presence.put)


def _without_screen(recording: Path | None, url: str) -> str:
    if recording:
        return f"There is no screen here. Copy {recording} to where there is one: noctule-viewer open {recording.name}"
    return f"There is no screen here. Connect a Rerun viewer to {url}, or open {_DEFAULT.page} in a browser."


def _fail(message: str, status: int = 1) -> NoReturn:
    print(f"noctule-viewer: {message}", file=sys.stderr)
    raise typer.Exit(status)
