"""A survey or a contour, from a file, as files of another format: what ``noctule-mapper export`` does."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from google.protobuf import json_format

from noctule import bounds, poses, survey
from noctule.errors import BoundsError, NoctuleError
from noctule.messages_pb2 import Contour
from noctule.progress import Progress
from noctule_mapper.config import MapperConfig, Window
from noctule_mapper.export.atomic_write import write_whole
from noctule_mapper.export.ros_map import OccupancyMap, occupancy_map, outline_map, pgm, yaml
from noctule_mapper.left_out import LeftOut
from noctule_mapper.messages import contour_message
from noctule_mapper.survey_fit import map_survey

_CONTOUR_FIELDS = {"walls", "corners", "cylinders", "method"}  # no Sweep has one of them
_ROS_SUFFIXES = (".yaml", ".yml")
_SUFFIXES = (".geojson", ".dxf", *_ROS_SUFFIXES)


class ExportError(NoctuleError):
    """An export that was asked for in a way that can't be."""


@dataclass(frozen=True)
class Exported:
    """The contour that was exported, and the sweeps of its survey that it does not rest on."""

    contour: Contour
    left_out: tuple[LeftOut, ...]


def check_suffix(out: Path) -> None:
    """Raises ExportError where the suffix is of no format."""
    if out.suffix not in _SUFFIXES:
        raise ExportError(f"{out} has the suffix {out.suffix!r}: name it by its format, {', '.join(_SUFFIXES)}")


def export_file(
    source: Path,
    out: Path,
    config: MapperConfig | None = None,
    window: Window | None = None,
    progress: Progress | None = None,
) -> Exported:
    """Write ``source`` to ``out`` in the format that its suffix names.

    Raises ExportError where the suffix is of no format, or where a contour comes with what only a survey is fitted by.
    """
    check_suffix(out)
    progress = progress or Progress()
    contour, left_out = _contour(source), ()
    if contour is None:
        surveyed = map_survey(survey.read_records(source), config, window=window, progress=progress)
        mapper, left_out = surveyed.mapper, surveyed.left_out
        if out.suffix in _ROS_SUFFIXES:
            progress.at("drawing the grid")
            mapper.draw_grid()  # before the contour, whose note says for how many sweeps it has no room
        progress.at("looking for walls and cylinders")
        contour = contour_message(mapper.contour(), site=surveyed.site)
        stated = [sweep for sweep in mapper.sweeps() if not sweep.pose_is_unknown]
        found = [pose for pose in contour.poses if poses.is_placed(pose)]
        places_m = np.array([(pose.x_m, pose.y_m) for pose in (*stated, *found)]).reshape(-1, 2)

        def ros_map() -> OccupancyMap:
            return occupancy_map(contour, mapper.grid.tiles(), places_m, mapper.config.grid)
    elif config or window:
        raise ExportError(
            f"{source} is fitted already: leave out --method, --rule, --sensor and --config, or give its survey"
        )
    else:
        ros_map = partial(outline_map, contour, MapperConfig().grid.cell_m)
    write_whole(_files(contour, ros_map, out))
    return Exported(contour, left_out)


def _files(contour: Contour, ros_map: Callable[[], OccupancyMap], out: Path) -> Mapping[Path, bytes]:
    if out.suffix == ".geojson":
        from noctule_mapper.export.geojson import geojson

        return {out: geojson(contour)}
    if out.suffix == ".dxf":
        from noctule_mapper.export.dxf import dxf

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
    except (ValueError, RecursionError):  # several lines of JSON, or none: the survey's reader says what is wrong
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
