"""The command ``export``: a survey or a contour, as a file for another program."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from google.protobuf import json_format

from noctule import survey
from noctule.errors import NoctuleError
from noctule.messages_pb2 import Contour
from noctule_mapper.config import GridConfig, MapperConfig, Method
from noctule_mapper.export.dxf import dxf
from noctule_mapper.export.geojson import geojson
from noctule_mapper.export.ros_map import occupancy_map, outline_map, pgm, yaml
from noctule_mapper.export.survey_map import survey_map
from noctule_mapper.grid import GridTile
from noctule_mapper.live_config import load_sensor
from noctule_mapper.whole_file import write_whole

_CONTOUR_FIELDS = {"walls", "corners", "cylinders", "method"}  # no Sweep has one of them
_ROS_SUFFIXES = (".yaml", ".yml")
_SUFFIXES = (".geojson", ".dxf", *_ROS_SUFFIXES)


class ExportError(NoctuleError):
    """An export that was asked for in a way that can't be."""


def export(
    source: Annotated[Path, typer.Argument(metavar="INPUT", help="A survey, or a contour that fit has written.")],
    out: Annotated[Path, typer.Argument(help=".geojson, .dxf, or .yaml: a ROS map, its .pgm beside it.")],
    method: Annotated[Method | None, typer.Option(help="How a survey's walls and cylinders are found.")] = None,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the survey's sensor.")] = None,
) -> None:
    """Export a contour to GeoJSON, DXF or a ROS map."""
    if out.suffix not in _SUFFIXES:
        raise ExportError(f"{out} has the suffix {out.suffix!r}: name it by its format, {', '.join(_SUFFIXES)}")
    config = MapperConfig() if method is None else MapperConfig(method=method)
    contour = _contour(source)
    tiles: list[GridTile] | None = None
    if contour is None:
        contour, tiles = survey_map(survey.read(source), config, load_sensor(sensor) if sensor else None)
    elif method is not None or sensor is not None:
        raise ExportError(f"{source} is a contour, fitted already: leave out --method and --sensor, or give its survey")
    write_whole(_files(contour, tiles, config.grid, out))
    print(
        f"{out}: {len(contour.walls)} walls, {len(contour.corners)} corners, {len(contour.cylinders)} cylinders, "
        "in metres of the site's frame"
    )


def _files(contour: Contour, tiles: list[GridTile] | None, grid: GridConfig, out: Path) -> Mapping[Path, bytes]:
    if out.suffix == ".geojson":
        return {out: geojson(contour)}
    if out.suffix == ".dxf":
        return {out: dxf(contour)}
    occupancy = outline_map(contour, grid.cell_m) if tiles is None else occupancy_map(contour, tiles, grid)
    image = out.with_suffix(".pgm")
    return {image: pgm(occupancy), out: yaml(occupancy, image.name)}


def _contour(source: Path) -> Contour | None:
    """The contour in the file, None where it holds sweeps."""
    if source.suffix == survey.MCAP_SUFFIX:
        return None
    try:
        fields = json.loads(source.read_text(encoding="utf-8"))
    except ValueError:  # several lines of JSON, or none: the survey's reader says what is wrong
        return None
    if not isinstance(fields, dict) or not _CONTOUR_FIELDS & fields.keys():
        return None
    try:
        contour = json_format.ParseDict(fields, Contour())
    except json_format.ParseError as error:
        raise ExportError(f"{source} is not a contour: {error}") from error
    if bad := survey.not_finite(contour):
        raise ExportError(f"{source}: {bad} is not finite: fit the survey again")
    return contour
