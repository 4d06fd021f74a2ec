"""The command ``share``: map those of several sites that fall to this mapper, and take over when another is gone."""

import threading
from pathlib import Path
from typing import Annotated

import typer

from noctule import rerun_paths
from noctule.logs import LogFormat
from noctule.program_options import NAME, Format, Metrics, Tls
from noctule_mapper.cli.live_options import Config, Connect, Rerun, relay


def share(
    site: Annotated[
        list[str],
        typer.Option(metavar="SITE", callback=NAME, help="A site to share; give each one, the same to every mapper."),
    ],
    data: Annotated[Path, typer.Option(help="Folder of the stores, one folder a site; made if it is not there.")],
    name: Annotated[
        str | None,
        typer.Option(callback=NAME, help="This mapper's name, unlike all others'; its certificate's, or its host's."),
    ] = None,
    connect: Connect = None,
    rerun: Rerun = rerun_paths.DEFAULT_RELAY,
    config: Config = None,
    tls: Tls = None,
    metrics: Metrics = None,
    log_format: Format = LogFormat.TEXT,
) -> None:
    """Share sites with other mappers: each site is mapped by one of those that are up."""
    import socket

    from noctule.tls import service_name
    from noctule_mapper.live.config import in_force
    from noctule_mapper.live.process import run_process
    from noctule_mapper.live.service import LiveSettings
    from noctule_mapper.sharing import service

    def serve(stop: threading.Event) -> None:
        named = name or service_name(tls, socket.gethostname().partition(".")[0].lower())
        parameters = in_force(config)
        sites = [
            LiveSettings(each, named, data / each, connect or [], relay(rerun), parameters, tls)
            for each in dict.fromkeys(site)
        ]
        service.run(service.SharedSites(data, sites, log_format, metrics), stop)

    run_process(serve, log_format)
