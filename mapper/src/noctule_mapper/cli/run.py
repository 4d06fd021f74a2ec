"""The command ``run``: map a site live."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import rerun_paths


def run(
    site: Annotated[str, typer.Option(help="The site to map.")],
    data: Annotated[Path, typer.Option(help="Folder of the mapper's store.")],
    connect: Annotated[list[str] | None, typer.Option(help="A Zenoh router; may be given several times.")] = None,
    rerun: Annotated[str, typer.Option(help="The Rerun relay, or 'none'.")] = rerun_paths.DEFAULT_RELAY,
    config: Annotated[Path | None, typer.Option(help="TOML file of parameters.")] = None,
    name: Annotated[str, typer.Option(help="The service's name on the bus.")] = "mapper",
) -> None:
    """Map a site as its sweeps come."""
    from noctule import bus
    from noctule_mapper.live.process import run_process

    run_process(site, name, data, connect or [bus.DEFAULT_ROUTER], None if rerun == "none" else rerun, config)
