"""The command ``run``: map a site live."""

import threading
from pathlib import Path
from typing import Annotated

import typer

from noctule import rerun_paths
from noctule.logs import LogFormat
from noctule.program_options import NAME, Format, Metrics, Tls
from noctule_mapper.cli.live_options import Config, Connect, Rerun, relay


def run(
    site: Annotated[str, typer.Option(callback=NAME, help="The site to map.")],
    data: Annotated[Path, typer.Option(help="Folder of the mapper's store; made if it is not there.")],
    connect: Connect = None,
    rerun: Rerun = rerun_paths.DEFAULT_RELAY,
    config: Config = None,
    name: Annotated[
        str | None,
        typer.Option(callback=NAME, help="The service's name on the bus; its certificate's, or 'mapper', if left out."),
    ] = None,
    tls: Tls = None,
    metrics: Metrics = None,
    log_format: Format = LogFormat.TEXT,
) -> None:
    """Map a site as its sweeps come."""
    from noctule.tls import service_name
    from noctule_mapper.live import service
    from noctule_mapper.live.config import in_force
    from noctule_mapper.live.map_process import run_map
    from noctule_mapper.live.nursery import Nursery
    from noctule_mapper.live.process import run_process

    nursery = Nursery(run_map, log_format)

    def serve(stop: threading.Event) -> None:
        named = name or service_name(tls, "mapper")
        settings = service.LiveSettings(site, named, data, connect or [], relay(rerun), in_force(config), tls, metrics)
        service.run(settings, stop, nursery)

    run_process(serve, log_format)
