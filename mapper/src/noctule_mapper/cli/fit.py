"""The command ``fit``: a survey from a file, its contour into another."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.program_options import check_folders, suffixed
from noctule_mapper.choices import DEFAULT_METHOD, DEFAULT_RULE, Method, Rule


def fit(
    sweeps: Annotated[Path, typer.Argument(metavar="SURVEY", help="Sweeps as JSON lines, or MCAP by suffix.")],
    contour: Annotated[
        Path | None, typer.Option(callback=suffixed(".json"), help="Where the contour goes, as JSON.")
    ] = None,
    method: Annotated[
        Method | None, typer.Option(help=f"How reflectors are found; {DEFAULT_METHOD} if left out.")
    ] = None,
    rule: Annotated[
        Rule | None, typer.Option(help=f"How the grid's beliefs are fused; {DEFAULT_RULE} if left out.")
    ] = None,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the sensor's calibration.")] = None,
    config: Annotated[
        Path | None, typer.Option(help="TOML file with the tables window and mapper, as for run.")
    ] = None,
    contacts: Annotated[
        Path | None,
        typer.Option(
            callback=suffixed(".csv"),
            help="Where what each reading touched goes, as CSV: by tangent circle and by R2d.",
        ),
    ] = None,
    svg: Annotated[
        Path | None,
        typer.Option(callback=suffixed(".svg"), help="Where a drawing goes: echoes, places and what was found."),
    ] = None,
    rrd: Annotated[
        Path | None,
        typer.Option(callback=suffixed(".rrd"), help="Where a Rerun recording goes: the live map's scene."),
    ] = None,
    view: Annotated[
        bool, typer.Option("--view", help="Open the viewer on the recording, beside the survey if --rrd names none.")
    ] = False,
) -> None:
    """Fit the contour of a survey, and print it; the parameters in force go beside it."""
    from noctule import survey
    from noctule.progress import progress
    from noctule_mapper.cli.drawings import draw
    from noctule_mapper.contour.table import contour_table
    from noctule_mapper.export.atomic_write import is_device, write_whole
    from noctule_mapper.live.config import in_force, to_toml
    from noctule_mapper.messages import contour_message
    from noctule_mapper.survey_fit import map_survey

    check_folders(contour, contacts, svg, rrd)
    parameters = in_force(config, method, rule, sensor)
    with progress() as shown:
        surveyed = map_survey(survey.read_records(sweeps), parameters.mapper, window=parameters.window, progress=shown)
        if rrd or view:
            surveyed.mapper.draw_grid()  # before the contour, whose note says for how many sweeps it has no room
        shown.at("looking for walls and cylinders")
        result = contour_message(surveyed.mapper.contour(), site=surveyed.site)
    if contour:
        contents = {contour: f"{survey.to_json(result)}\n".encode()}
        if not is_device(contour):
            contents[contour.with_suffix(".config.toml")] = to_toml(parameters).encode()
        write_whole(contents)
    if contacts:
        write_whole({contacts: surveyed.mapper.contact_report().csv().encode()})
    print(contour_table(result))
    for left_out in surveyed.left_out:
        typer.echo(str(left_out), err=True)
    draw(surveyed.mapper, result, svg, rrd or (sweeps.with_suffix(".rrd") if view else None), view)
