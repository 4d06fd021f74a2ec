"""The command ``export``: a survey or a contour, as a file for another program."""

import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from google.protobuf import json_format

from noctule import bounds, survey
from noctule.errors import BoundsError, NoctuleError
from noctule.messages_pb2 import Contour
from noctule_mapper.config import MapperConfig, Method
from noctule_mapper.export.dxf import dxf
from noctule_mapper.export.geojson import geojson
from noctule_mapper.export.ros_map import OccupancyMap, occupancy_map, outline_map, pgm, yaml
from noctule_mapper.fit import map_survey
from noctule_mapper.fusion import Rule
from noctule_mapper.live.config import load_sensor
from noctule_mapper.report import contour_message
from noctule_mapper.whole_file import write_whole

_DEFAULT = MapperConfig()
_CONTOUR_FIELDS = {"walls", "corners", "cylinders", "method"}  # no Sweep has one of them
_ROS_SUFFIXES = (".yaml", ".yml")
_SUFFIXES = (".geojson", ".dxf", *_ROS_SUFFIXES)


class ExportError(NoctuleError):
    """An export that was asked for in a way that can't be."""


def export(
    source: Annotated[Path, typer.Argument(metavar="INPUT", help="A survey, or a contour that fit has written.")],
    out: Annotated[Path, typer.Argument(help=".geojson, .dxf, or .yaml: a ROS map, its .pgm beside it.")],
    method: Annotated[Method | None, typer.Option(help="How a survey's walls and cylinders are found.")] = None,
    rule: Annotated[Rule | None, typer.Option(help="How the beliefs of a survey's grid are fused.")] = None,
    sensor: Annotated[Path | None, typer.Option(help="TOML file of the survey's sensor.")] = None,
) -> None:
    """Export a contour to GeoJSON, DXF or a ROS map."""
    if out.suffix not in _SUFFIXES:
        raise ExportError(f"{out} has the suffix {out.suffix!r}: name it by its format, {', '.join(_SUFFIXES)}")
    config = MapperConfig(method=method or _DEFAULT.method, rule=rule or _DEFAULT.rule)
    contour = _contour(source)
    if contour is None:
        sweeps = list(survey.read(source))
        mapper, site = map_survey(sweeps, config, load_sensor(sensor) if sensor else None)
        contour = contour_message(mapper.contour(), site=site)
        places_m = np.array([(sweep.pose.x_m, sweep.pose.y_m) for sweep in sweeps]).reshape(-1, 2)
        ros_map = partial(occupancy_map, contour, mapper.grid.tiles(), places_m, config.grid)
    elif method or rule or sensor:
        raise ExportError(f"{source} is fitted already: leave out --method, --rule and --sensor, or give its survey")
    else:
        ros_map = partial(outline_map, contour, config.grid.cell_m)
    write_whole(_files(contour, ros_map, out))
    print(
        f"{out}: walls {len(contour.walls)}, corners {len(contour.corners)}, cylinders {len(contour.cylinders)}; "
        "metres in the site's frame"
    )


def _files(contour: Contour, ros_map: Callable[[], OccupancyMap], out: Path) -> Mapping[Path, bytes]:
    if out.suffix == ".geojson":
        return {out: geojson(contour)}
    if out.suffix == ".dxf":
        return {out: dxf(contour)}
    image = out.with_suffix(".pgm")
    occupancy = ros_map()
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
    try:
        bounds.check(contour)
    except BoundsError as error:
        raise ExportError(f"{source}: {error}: fit the survey again") from error
    return contour
