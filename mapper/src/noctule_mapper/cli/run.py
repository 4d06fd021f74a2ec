"""The command ``run``: map a site live."""

import logging
import os
import signal
import threading
from pathlib import Path
from typing import Annotated

import typer

from noctule import bus, scene
from noctule.errors import NoctuleError
from noctule_mapper.live import service as live
from noctule_mapper.live.config import LiveConfig, load_live

_log = logging.getLogger(__name__)


def run(
    site: Annotated[str, typer.Option(help="The site to map.")],
    data: Annotated[Path, typer.Option(help="Folder of the mapper's store.")],
    connect: Annotated[list[str] | None, typer.Option(help="A Zenoh router; may be given several times.")] = None,
    rerun: Annotated[str, typer.Option(help="The Rerun relay, or 'none'.")] = scene.DEFAULT_RELAY,
    config: Annotated[Path | None, typer.Option(help="TOML file of parameters.")] = None,
    name: Annotated[str, typer.Option(help="The service's name on the bus.")] = "mapper",
) -> None:
    """Map a site as its sweeps come."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    try:
        parameters = load_live(config) if config else LiveConfig()
        rerun_url = None if rerun == "none" else rerun
        live.run(live.LiveSettings(site, name, data, connect or [bus.DEFAULT_ROUTER], rerun_url, parameters), stop)
        status = 0
    except NoctuleError as error:
        _log.error("%s", error)
        status = 1
    except Exception:
        _log.exception("the mapper has failed; its store is whole, and a new start goes on from it")
        status = 1
    # All that matters is closed. On its way out Rerun's SDK would wait without end for a relay that takes nothing.
    logging.shutdown()
    os._exit(status)
