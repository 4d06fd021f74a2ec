"""The command ``router``: be the router alone."""

import logging
from typing import Annotated

import typer

from noctule import tls
from noctule.errors import NoctuleError
from noctule.logs import LogFormat
from noctule.program_options import ENDPOINT, Format, Metrics, Tls
from noctule_gateway.cli.options import DEFAULT_LISTEN

_log = logging.getLogger(__name__)


def router(
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            callback=ENDPOINT,
            help=f"Where; {DEFAULT_LISTEN} without --tls, else as its folder says.",
        ),
    ] = None,
    connect: Annotated[
        list[str] | None, typer.Option(metavar="ENDPOINT", callback=ENDPOINT, help="Another router to link with.")
    ] = None,
    tls_folder: Tls = None,
    metrics: Metrics = None,
    log_format: Format = LogFormat.TEXT,
) -> None:
    """Be the router alone, for gateways with --connect, until SIGTERM or Ctrl-C."""
    from noctule_gateway.cli.process import begin
    from noctule_gateway.router import serve

    ending = begin(log_format)
    try:
        default = [] if tls.chosen(tls_folder) else [DEFAULT_LISTEN]
        serve(listen or default, connect or [], tls_folder, metrics, ending)
    except (NoctuleError, OSError) as error:
        _log.error("%s", error)
        raise typer.Exit(1) from error
