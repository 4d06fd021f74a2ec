"""The command ``export``: a survey or a contour, as a file for another program."""

from pathlib import Path
from typing import Annotated

import typer

from noctule.program_options import check_folders, checked
from noctule_mapper.choices import Method, Rule


def _format(out: Path) -> None:
    from noctule_mapper.export.files import check_suffix

    check_suffix(out)


def export(
    source: Annotated[Path, typer.Argument(metavar="INPUT", help="A survey, or a contour that fit has written.")],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", callback=checked(_format), help=".geojson, .dxf, or .yaml: a ROS map, its .pgm beside it."
        ),
    ],
    method: Annotated[Method | None, typer.Option(help="How a survey's walls and cylinders are found.")] = None,
    rule: Annotated[Rule | None, typer.Option(help="How the beliefs of a survey's grid are fused.")] = None,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the survey's sensor.")] = None,
    config: Annotated[
        Path | None, typer.Option(help="TOML file with the tables window and mapper, as for run.")
    ] = None,
) -> None:
    """Export a contour to GeoJSON, DXF or a ROS map."""
    from noctule.progress import progress
    from noctule_mapper.export.files import export_file
    from noctule_mapper.live.config import in_force

    check_folders(out)
    parameters = in_force(config, method, rule, sensor) if method or rule or sensor or config else None
    mapper, window = (parameters.mapper, parameters.window) if parameters else (None, None)
    with progress() as shown:
        exported = export_file(source, out, mapper, window, shown)
    contour = exported.contour
    print(
        f"{out}: walls {len(contour.walls)}, corners {len(contour.corners)}, cylinders {len(contour.cylinders)}; "
        "metres in the site's frame"
    )
    if contour.note:
        print(contour.note)
    for left_out in exported.left_out:
        typer.echo(str(left_out), err=True)
