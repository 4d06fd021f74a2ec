"""The command noctule-mapper: ``run`` maps a site live, ``fit`` a survey from a file."""

import logging
import os
import signal
import sys
import threading
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from noctule import bus, scene, survey
from noctule.errors import NoctuleError
from noctule_mapper import live
from noctule_mapper.config import MapperConfig, Method
from noctule_mapper.contour_table import contour_table
from noctule_mapper.fit import fit as fit_survey
from noctule_mapper.live_config import LiveConfig, load_live, load_sensor

app = typer.Typer(
    no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False, help="Sweeps to contours."
)

_log = logging.getLogger(__name__)

_METHOD = MapperConfig().method


@app.command()
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


@app.command()
def fit(
    sweeps: Annotated[Path, typer.Argument(metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix.")],
    contour: Annotated[Path, typer.Option(help="Where the contour goes, as JSON.")],
    method: Annotated[Method, typer.Option(help="How walls and cylinders are found.")] = _METHOD,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the sensor's calibration.")] = None,
) -> None:
    """Fit the contour of a survey, and print it."""
    try:
        calibration = load_sensor(sensor) if sensor else None
        result = fit_survey(survey.read(sweeps), MapperConfig(method=method), calibration)
        contour.write_text(survey.to_json(result) + "\n")
    except (NoctuleError, OSError) as error:
        _fail(error)
    print(contour_table(result))


def _fail(error: Exception) -> NoReturn:
    print(f"noctule-mapper: {error}", file=sys.stderr)
    raise typer.Exit(1) from error
