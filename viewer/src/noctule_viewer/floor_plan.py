"""A floor plan from a file, DXF or GeoJSON, as lines in the site's frame."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from math import cos, isfinite, radians, sin
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from noctule.errors import NoctuleError

if TYPE_CHECKING:
    from ezdxf.document import Drawing

MOST_POINTS = 50_000  # more would weigh on every page that shows the map
_CURVES_TO = 0.002  # of the drawing's larger side: how far a chord may be from its curve
_LINES_OF = {"LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE"}
_LEAST_SIDE_M, _MOST_SIDE_M = 0.5, 10_000.0
_PLACING = "X,Y,DEGREES or X,Y,DEGREES,SCALE, as in 1.5,-2,90,0.001"


class FloorPlanError(NoctuleError):
    """A floor plan that can't be shown; the message says what to do."""


@dataclass(frozen=True)
class Placing:
    """Where the drawing lies in the site's frame: it is scaled, turned about its own origin, then moved.

    ``metres_per_unit`` None: as the drawing states its units.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    turned_rad: float = 0.0
    metres_per_unit: float | None = None


def placing(text: str) -> Placing:
    """From what a user types. Raises FloorPlanError."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(isfinite, numbers)) or (len(numbers) == 4 and numbers[3] <= 0):
        raise FloorPlanError(f"the floor plan can't be placed at {text!r}: give {_PLACING}")
    return Placing(numbers[0], numbers[1], radians(numbers[2]), numbers[3] if len(numbers) == 4 else None)


def load(path: Path, at: Placing) -> list[np.ndarray]:
    """Its lines, each (points, 2) in metres in the site's frame. Raises FloorPlanError."""
    readers = {".dxf": _dxf, ".geojson": _geojson, ".json": _geojson}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise FloorPlanError(f"{path} is no floor plan: give a .dxf or a .geojson file")
    if not path.is_file():
        raise FloorPlanError(f"there is no file {path}: give the floor plan's path")
    try:
        lines, unit_m = reader(path)
    except OSError as error:
        raise FloorPlanError(f"{path} can't be read: {error.strerror or error}") from error
    if not lines:
        raise FloorPlanError(f"{path} has no lines in it: walls must be lines, polylines, arcs or circles")
    if (points := sum(map(len, lines))) > MOST_POINTS:
        raise FloorPlanError(f"{path} has {points} points, of which {MOST_POINTS} can be shown: leave furniture out")
    scale = at.metres_per_unit or unit_m
    if scale is None:
        raise FloorPlanError(f"{path} does not state its units: say how many metres one is, as in 0,0,0,0.001")
    return _placed(path, lines, at, scale)


def _placed(path: Path, lines: Sequence[np.ndarray], at: Placing, scale: float) -> list[np.ndarray]:
    everything = np.concatenate(lines)
    if not np.isfinite(everything).all():
        raise FloorPlanError(f"{path} has coordinates that are not numbers")
    side_m = scale * float(np.ptp(everything, axis=0).max())
    if not _LEAST_SIDE_M <= side_m <= _MOST_SIDE_M:
        raise FloorPlanError(
            f"{path} would be {side_m:g} m wide: say how many metres one of its units is, as in 0,0,0,0.001"
        )
    c, s = cos(at.turned_rad), sin(at.turned_rad)
    return [np.array([at.x_m, at.y_m]) + scale * line @ np.array([[c, s], [-s, c]]) for line in lines]


def _dxf(path: Path) -> tuple[list[np.ndarray], float | None]:
    """Lines of the model space, those in blocks too, and the metres of a unit; layers that are off are left out, and
    blocks that are inserted on them.
    """
    from ezdxf.enums import InsertUnits  # takes half a second, and only this needs it
    from ezdxf.filemanagement import readfile
    from ezdxf.lldxf.const import DXFError
    from ezdxf.units import conversion_factor

    try:
        drawing = readfile(path)
        lines = _dxf_lines(drawing)
        unit_m = conversion_factor(InsertUnits(drawing.units), InsertUnits.Meters) if drawing.units else None
    except (DXFError, OSError, ValueError, TypeError, RecursionError) as error:
        raise FloorPlanError(f"{path} is no DXF drawing that can be read: {error}") from error
    if lines is None:
        raise FloorPlanError(f"{path} has more than {MOST_POINTS} parts, blocks unpacked: leave furniture out")
    return lines, unit_m


def _dxf_lines(drawing: "Drawing") -> list[np.ndarray] | None:
    """None where blocks in blocks are more than can be shown."""
    from ezdxf import disassemble

    hidden = {layer.dxf.name.lower() for layer in drawing.layers if layer.is_off() or layer.is_frozen()}
    top = (entity for entity in drawing.modelspace() if entity.dxf.layer.lower() not in hidden)
    found = list(islice(disassemble.recursive_decompose(top), MOST_POINTS + 1))
    if len(found) > MOST_POINTS:
        return None
    shown = [each for each in found if each.dxftype() in _LINES_OF and each.dxf.layer.lower() not in hidden]
    paths = [made.path for made in disassemble.to_primitives(shown) if made.path is not None]
    corners = np.array([(each.x, each.y) for one in paths for each in one.control_vertices()]).reshape(-1, 2)
    chord = _CURVES_TO * float(np.ptp(corners, axis=0).max()) if len(corners) else 0.0
    lines = [np.array([(each.x, each.y) for each in one.flattening(chord or 0.01)]) for one in paths]
    return [line for line in lines if len(line) > 1]


def _geojson(path: Path) -> tuple[list[np.ndarray], float | None]:
    """Lines and rims of polygons; coordinates are metres, as in what noctule-mapper export writes."""
    try:
        top = json.loads(path.read_text(encoding="utf-8-sig"))
        lines = [np.array([place[:2] for place in line], dtype=float) for line in _lines(top)]
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise FloorPlanError(f"{path} is no GeoJSON: {error!r}") from error
    return [line for line in lines if line.ndim == 2 and line.shape[0] > 1 and line.shape[1] == 2], 1.0


def _lines(of: Any) -> Iterator[Sequence[Any]]:
    if not isinstance(of, dict):
        raise ValueError("an object is not one")
    kind = of.get("type")
    if kind == "FeatureCollection":
        parts = [line for feature in of["features"] for line in _lines(feature)]
    elif kind == "Feature":
        parts = list(_lines(of["geometry"])) if of.get("geometry") else []
    elif kind == "GeometryCollection":
        parts = [line for each in of["geometries"] for line in _lines(each)]
    elif kind == "LineString":
        parts = [of["coordinates"]]
    elif kind in ("MultiLineString", "Polygon"):
        parts = of["coordinates"]
    elif kind == "MultiPolygon":
        parts = [ring for polygon in of["coordinates"] for ring in polygon]
    elif kind in ("Point", "MultiPoint"):
        parts = []
    else:
        raise ValueError(f"{kind!r} is no type of it")
    yield from parts
