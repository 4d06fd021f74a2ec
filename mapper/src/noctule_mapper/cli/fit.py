"""The command ``fit``: a survey from a file, its contour into another."""

from pathlib import Path
from typing import Annotated

import typer

from noctule_mapper.choices import DEFAULT_METHOD, DEFAULT_RULE, Method, Rule


def fit(
    sweeps: Annotated[Path, typer.Argument(metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix.")],
    contour: Annotated[Path | None, typer.Option(help="Where the contour goes, as JSON.")] = None,
    method: Annotated[Method, typer.Option(help="How walls and cylinders are found.")] = DEFAULT_METHOD,
    rule: Annotated[Rule, typer.Option(help="How the grid's beliefs are fused.")] = DEFAULT_RULE,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the sensor's calibration.")] = None,
    contacts: Annotated[
        Path | None, typer.Option(help="Where what each reading touched goes, as CSV: by tangent circle and by R2d.")
    ] = None,
    svg: Annotated[Path | None, typer.Option(help="Where a drawing goes: echoes, places and what was found.")] = None,
    rrd: Annotated[Path | None, typer.Option(help="Where a Rerun recording goes: the live map's scene.")] = None,
    view: Annotated[
        bool, typer.Option("--view", help="Open the viewer on the recording, beside the survey if --rrd names none.")
    ] = False,
) -> None:
    """Fit the contour of a survey, and print it."""
    from noctule import survey
    from noctule_mapper.cli.drawings import draw
    from noctule_mapper.config import MapperConfig
    from noctule_mapper.contour.table import contour_table
    from noctule_mapper.live.config import load_sensor
    from noctule_mapper.messages import contour_message
    from noctule_mapper.survey_fit import map_survey

    calibration = load_sensor(sensor) if sensor else None
    mapper, site = map_survey(survey.read(sweeps), MapperConfig(method=method, rule=rule), calibration)
    result = contour_message(mapper.contour(), site=site)
    if contour:
        contour.write_text(survey.to_json(result) + "\n")
    if contacts:
        contacts.write_text(mapper.contact_report().csv())
    print(contour_table(result))
    draw(mapper, result, svg, rrd or (sweeps.with_suffix(".rrd") if view else None), view)
