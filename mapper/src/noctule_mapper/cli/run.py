"""The command ``run``: map a site live."""

import threading
from pathlib import Path
from typing import Annotated

import typer

from noctule import rerun_paths
from noctule.logs import FORMAT_VARIABLE, LogFormat


def run(
    site: Annotated[str, typer.Option(help="The site to map.")],
    data: Annotated[Path, typer.Option(help="Folder of the mapper's store.")],
    connect: Annotated[list[str] | None, typer.Option(help="A Zenoh router; may be given several times.")] = None,
    rerun: Annotated[str, typer.Option(help="The Rerun relay, or 'none'.")] = rerun_paths.DEFAULT_RELAY,
    config: Annotated[Path | None, typer.Option(help="TOML file of parameters.")] = None,
    name: Annotated[
        str | None, typer.Option(help="The service's name on the bus; its certificate's, or 'mapper', if left out.")
    ] = None,
    tls: Annotated[
        Path | None,
        typer.Option(
            envvar="NOCTULE_TLS", metavar="FOLDER", help="Certificate and key: a folder that noctule-deploy made."
        ),
    ] = None,
    metrics: Annotated[str | None, typer.Option(metavar="HOST:PORT", help="Serve Prometheus metrics here.")] = None,
    log_format: Annotated[
        LogFormat, typer.Option(envvar=FORMAT_VARIABLE, help="The log as text, or as JSON lines.")
    ] = LogFormat.TEXT,
) -> None:
    """Map a site as its sweeps come."""
    from noctule import tls as tls_folders
    from noctule_mapper.live import service
    from noctule_mapper.live.config import LiveConfig, load_live
    from noctule_mapper.live.process import run_process

    def serve(stop: threading.Event) -> None:
        parameters = load_live(config) if config else LiveConfig()
        service_name = name or tls_folders.service_name(tls, "mapper")
        relay = None if rerun == "none" else rerun
        settings = service.LiveSettings(site, service_name, data, connect or [], relay, parameters, tls, metrics)
        service.run(settings, stop)

    run_process(serve, log_format)
