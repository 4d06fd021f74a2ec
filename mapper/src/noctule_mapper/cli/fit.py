"""The command ``fit``: a survey from a file, its contour into another."""

from pathlib import Path
from typing import Annotated

import typer

from noctule import survey
from noctule_mapper.config import MapperConfig, Method
from noctule_mapper.contour_table import contour_table
from noctule_mapper.fit import fit as fit_survey
from noctule_mapper.live_config import load_sensor

_DEFAULT = MapperConfig()


def fit(
    sweeps: Annotated[Path, typer.Argument(metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix.")],
    contour: Annotated[Path, typer.Option(help="Where the contour goes, as JSON.")],
    method: Annotated[Method, typer.Option(help="How walls and cylinders are found.")] = _DEFAULT.method,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the sensor's calibration.")] = None,
) -> None:
    """Fit the contour of a survey, and print it."""
    calibration = load_sensor(sensor) if sensor else None
    result = fit_survey(survey.read(sweeps), MapperConfig(method=method), calibration)
    contour.write_text(survey.to_json(result) + "\n")
    print(contour_table(result))
