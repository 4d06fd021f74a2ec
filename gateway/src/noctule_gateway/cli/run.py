"""The command ``run``: serve the units of a site."""

import logging
from pathlib import Path
from typing import Annotated

import typer

from noctule import logs, tls
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.program_options import ENDPOINT, NAME, Format, Metrics, Tls
from noctule_gateway.cli.options import DEFAULT_LISTEN, FirmwareFile

_log = logging.getLogger(__name__)


def run(
    site_file: Annotated[Path, typer.Argument(metavar="SITE.toml", help="The site whose units to serve.")],
    data: Annotated[Path, typer.Option(help="Folder of the units' logs; made if it is not there.")],
    connect: Annotated[
        list[str] | None,
        typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="A router of the bus; give more for a fallback."),
    ] = None,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            callback=ENDPOINT,
            help=f"Be the router, at this endpoint; {DEFAULT_LISTEN} without --connect and --tls.",
        ),
    ] = None,
    tls_folder: Tls = None,
    firmware: FirmwareFile = None,
    name: Annotated[
        str | None,
        typer.Option(
            callback=NAME, help="Its name among the site's services; its certificate's, or 'gateway', if left out."
        ),
    ] = None,
    keep_mb: Annotated[float, typer.Option(min=1, help="Size of each unit's log, in MB of sweeps.")] = 256,
    keep_days: Annotated[float, typer.Option(min=0, help="Age at which sweeps leave the log.")] = 30,
    metrics: Metrics = None,
    log_format: Format = LogFormat.TEXT,
) -> None:
    """Serve the units of a site until SIGTERM or Ctrl-C."""
    from noctule_gateway.cli.process import begin
    from noctule_gateway.cli.serve import Access, serve
    from noctule_gateway.log.log_file import Retention

    ending = begin(log_format)
    retention = Retention(max_bytes=round(keep_mb * 1e6), max_age_s=keep_days * 86400)
    try:
        default = [] if connect or tls_folder else [DEFAULT_LISTEN]
        access = Access(connect or [], listen or default, tls_folder, firmware, metrics)
        serve(site_file, data, name or tls.service_name(tls_folder, "gateway"), retention, access, ending)
    except (NoctuleError, OSError) as error:
        logs.log_lines(_log, error)
        raise typer.Exit(1) from error
