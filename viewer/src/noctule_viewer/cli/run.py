"""The command ``run``: the relay, and what is shown beside the map."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from noctule import logs, tls
from noctule.endpoints import LAST_PORT
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.program_options import ENDPOINT, SITE, Format, Metrics, checked
from noctule_viewer import memory_limit as memory_limits
from noctule_viewer.address import DEFAULT_BIND, DEFAULT_PORT, DEFAULT_WEB_PORT
from noctule_viewer.cli.failing import fail

_log = logging.getLogger(__name__)


def _placing(typed: str) -> None:
    from noctule_viewer.floor_plan import placing  # which loads NumPy

    placing(typed.rpartition("=")[2])


def run(
    context: typer.Context,
    bind: Annotated[
        str, typer.Option(help="Address to listen on. The relay has no passwords: keep it on loopback.")
    ] = DEFAULT_BIND,
    port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port for mappers and native viewers.")
    ] = DEFAULT_PORT,
    web_port: Annotated[
        int, typer.Option(min=1, max=LAST_PORT, help="Port of the page for browsers.")
    ] = DEFAULT_WEB_PORT,
    memory_limit: Annotated[
        str,
        typer.Option(
            callback=checked(memory_limits.checked),
            help="How much history to keep for viewers that come later; it costs 2.3 times as much.",
        ),
    ] = memory_limits.DEFAULT,
    site: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|FILE",
            callback=SITE,
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
            callback=checked(_placing),
            help="Where the drawing's origin lies on the map, in metres, how far it is turned anticlockwise, "
            "and how many metres its unit is (default: as the drawing says).",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None,
        typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="With --site: a router; give more for a fallback."),
    ] = None,
    tls_folder: Annotated[
        Path | None,
        typer.Option(
            "--tls",
            envvar=tls.FOLDER_VARIABLE,
            metavar="FOLDER",
            help="With --site: certificate and key, a folder that noctule-deploy render made. It also names the "
            "routers.",
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
    metrics: Metrics = None,
    log_format: Format = LogFormat.TEXT,
) -> None:
    """Run the relay and print the address to open."""
    if (floor_plan or floor_plan_at) and not site:
        fail("a floor plan belongs to a site: give --site too", 2)
    source = context.get_parameter_source("tls_folder")
    if not site and source is not None and source.name == "COMMANDLINE":  # a variable may be for other programs too
        fail("--tls is for the bus, on which a site is watched: give --site too", 2)
    if port == web_port:
        fail(f"--port and --web-port are both {port}: give each a port of its own", 2)
    from noctule.ending import Ending
    from noctule_viewer.board.site_plan import SitePlanError, read
    from noctule_viewer.relay import Relay
    from noctule_viewer.serve import Recorded, Watched, serve

    logs.set_up(log_format)
    ending = Ending()

    def announce() -> None:
        if log_format is LogFormat.JSON:
            _log.info("Watch the map at %s", relay.page)
        else:
            print(f"Watch the map at {relay.page}", flush=True)

    try:
        relay = Relay(bind, port, web_port, memory_limit)
        relay.check_ports()
        watched = (
            Watched(read(site, floor_plan or [], floor_plan_at or []), connect or [], tls_folder) if site else None
        )
        recorded = Recorded(record, keep_days) if record else None
        status = serve(relay, announce, watched, recorded, metrics, ending)
    except SitePlanError as error:
        fail(str(error), 2)
    except NoctuleError as error:
        logs.log_lines(_log, error)
        raise typer.Exit(1) from error
    _log.error("the relay ended by itself, with status %d", status)
    raise typer.Exit(status if status > 0 else 128 - status)
