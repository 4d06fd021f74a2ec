"""The command ``share``: map those of several sites that fall to this mapper, and take over when another is gone."""

import threading
from pathlib import Path
from typing import Annotated

import typer

from noctule import rerun_paths
from noctule.logs import FORMAT_VARIABLE, LogFormat


def share(
    site: Annotated[list[str], typer.Option(help="A site to share; give each one, the same to every mapper.")],
    data: Annotated[Path, typer.Option(help="Folder of the stores, one folder a site.")],
    name: Annotated[
        str | None, typer.Option(help="This mapper's name, unlike all others'; its certificate's if left out.")
    ] = None,
    connect: Annotated[list[str] | None, typer.Option(help="A Zenoh router; may be given several times.")] = None,
    rerun: Annotated[str, typer.Option(help="The Rerun relay, or 'none'.")] = rerun_paths.DEFAULT_RELAY,
    config: Annotated[Path | None, typer.Option(help="TOML file of parameters.")] = None,
    tls: Annotated[
        Path | None,
        typer.Option(
            envvar="NOCTULE_TLS", metavar="FOLDER", help="Certificate and key: a folder that noctule-deploy made."
        ),
    ] = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Share sites with other mappers: each site is mapped by one of those that are up."""
    import socket

    from noctule import tls as tls_folders
    from noctule_mapper.live.config import LiveConfig, load_live
    from noctule_mapper.live.process import run_process
    from noctule_mapper.live.service import LiveSettings
    from noctule_mapper.sharing import service

    def serve(stop: threading.Event) -> None:
        chosen = name or tls_folders.service_name(tls, socket.gethostname().partition(".")[0].lower())
        relay = None if rerun == "none" else rerun
        parameters = load_live(config) if config else LiveConfig()
        settings = LiveSettings("", chosen, data, connect or [], relay, parameters, tls)
        service.run(service.SharedSites(site, settings, log_format), stop)

    run_process(serve, log_format)
