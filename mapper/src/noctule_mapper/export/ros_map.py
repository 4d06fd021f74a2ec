"""A map for robots: an image of free, occupied and unknown cells and the YAML by which nav2's map_server loads it."""

import json
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from noctule.errors import NoctuleError
from noctule.messages_pb2 import Contour
from noctule_mapper.config import GridConfig
from noctule_mapper.export.shapes import rings, signed_area_m2
from noctule_mapper.grid.grid import CellState, GridTile, cell_states

# Pixels as ROS writes them. nav2_map_server/src/map_io.cpp, mode trinary, negate 0: with occ = (255 - pixel) / 255 a
# cell is occupied where occ > occupied_thresh, else free where occ < free_thresh, else unknown. An unknown pixel's occ
# is 0.1961, so nav2's usual free_thresh of 0.25 would make it free.
OCCUPIED_PIXEL, FREE_PIXEL, UNKNOWN_PIXEL = 0, 254, 205
OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
_PIXELS = {CellState.OCCUPIED: OCCUPIED_PIXEL, CellState.FREE: FREE_PIXEL, CellState.UNKNOWN: UNKNOWN_PIXEL}
_MARGIN_CELLS = 5
_MOST_CELLS = 100_000_000


class MapSizeError(NoctuleError):
    """A map that no image can hold."""


@dataclass(frozen=True)
class OccupancyMap:
    """``states`` is CellState, uint8 (rows, columns), row 0 the lowest y; (x_m, y_m) is its lower left corner."""

    states: np.ndarray
    x_m: float
    y_m: float
    cell_m: float


def occupancy_map(
    contour: Contour, tiles: Iterable[GridTile], places_m: np.ndarray, config: GridConfig
) -> OccupancyMap:
    """The grid's cells, and over them the contour's walls and cylinders, occupied. Beams are wide and tell of free
    space beyond a corner too: it stays unknown where walls part it from all ``places_m``, (n, 2), of the units.

    Raises MapSizeError where the map is too large for an image.
    """
    known = [(cell_states(tile.occupied, tile.free, config), tile) for tile in tiles]
    known = [(states, tile) for states, tile in known if states.any()]
    corners_m = [(tile.x_m, tile.y_m) for _, tile in known]
    corners_m += [(tile.x_m + s.shape[1] * tile.cell_m, tile.y_m + s.shape[0] * tile.cell_m) for s, tile in known]
    empty = _empty(np.array([*corners_m, *_extent_m(contour)]).reshape(-1, 2), config.cell_m)
    for states, tile in known:
        column, row = (round(each / config.cell_m) for each in (tile.x_m - empty.x_m, tile.y_m - empty.y_m))
        empty.states[row : row + states.shape[0], column : column + states.shape[1]] = states
    solid = _solid(contour, empty)
    empty.states[~_open_to(places_m, solid, empty) & (empty.states == CellState.FREE)] = CellState.UNKNOWN
    empty.states[solid] = CellState.OCCUPIED
    return _cropped(empty)


def outline_map(contour: Contour, cell_m: float) -> OccupancyMap:
    """A map from the contour alone: its walls and cylinders occupied, what its closed outlines enclose free. Raises
    MapSizeError where that is too large for an image.
    """
    empty = _empty(np.array(_extent_m(contour)).reshape(-1, 2), cell_m)
    x_m, y_m = _centres_m(empty)
    inner_last = sorted((ring.points for ring in rings(contour)), key=signed_area_m2, reverse=True)
    for points in inner_last:  # a wall has the room on its left: what goes round clockwise stands in the room
        within = CellState.FREE if signed_area_m2(points) > 0 else CellState.UNKNOWN
        empty.states[_inside(points, x_m, y_m)] = within
    empty.states[_solid(contour, empty)] = CellState.OCCUPIED
    return _cropped(empty)


def pgm(occupancy: OccupancyMap) -> bytes:
    """The image, a binary grey map (P5) whose top row has the largest y."""
    palette = np.array([_PIXELS[state] for state in sorted(_PIXELS)], np.uint8)
    rows, columns = occupancy.states.shape
    return f"P5\n{columns} {rows}\n255\n".encode() + palette[occupancy.states[::-1]].tobytes()


def yaml(occupancy: OccupancyMap, image: str) -> bytes:
    """The description of the image in the file ``image`` beside it."""
    return (
        f"image: {json.dumps(image)}\n"  # a JSON string is one in YAML, whatever it holds
        "mode: trinary\n"
        f"resolution: {occupancy.cell_m!r}\n"
        f"origin: [{occupancy.x_m:.6f}, {occupancy.y_m:.6f}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESH}\n"
        f"free_thresh: {FREE_THRESH}\n"
    ).encode()


def _extent_m(contour: Contour) -> list[tuple[float, float]]:
    ends = [(end.x_m, end.y_m) for wall in contour.walls for end in (wall.start, wall.end)]
    return ends + [
        (round_.x_m + sign * round_.radius_m, round_.y_m + sign * round_.radius_m)
        for round_ in contour.cylinders
        for sign in (-1, 1)
    ]


def _empty(points_m: np.ndarray, cell_m: float) -> OccupancyMap:
    """A map of unknown cells about ``points_m`` (n, 2), its corner a whole number of cells from the site's origin."""
    if not len(points_m):
        points_m = np.zeros((1, 2))
    low = np.floor(points_m.min(axis=0) / cell_m).astype(int) - _MARGIN_CELLS
    high = np.ceil(points_m.max(axis=0) / cell_m).astype(int) + _MARGIN_CELLS
    columns, rows = (int(each) for each in high - low)
    if columns * rows > _MOST_CELLS:
        raise MapSizeError(
            f"the map would be {columns} x {rows} cells of {cell_m:g} m: survey one place at a time, or check its poses"
        )
    return OccupancyMap(np.zeros((rows, columns), np.uint8), float(low[0] * cell_m), float(low[1] * cell_m), cell_m)


def _cropped(whole: OccupancyMap) -> OccupancyMap:
    """The part with known cells and a margin about it."""
    rows, columns = (np.flatnonzero(whole.states.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return whole
    row, column = max(int(rows[0]) - _MARGIN_CELLS, 0), max(int(columns[0]) - _MARGIN_CELLS, 0)
    part = whole.states[row : int(rows[-1]) + _MARGIN_CELLS + 1, column : int(columns[-1]) + _MARGIN_CELLS + 1]
    return OccupancyMap(part, whole.x_m + column * whole.cell_m, whole.y_m + row * whole.cell_m, whole.cell_m)


def _solid(contour: Contour, canvas: OccupancyMap) -> np.ndarray:
    """Which cells walls cross or cylinders cover, bool (rows, columns)."""
    solid = np.zeros(canvas.states.shape, bool)
    for wall in contour.walls:
        ends_m = np.array([(end.x_m - canvas.x_m, end.y_m - canvas.y_m) for end in (wall.start, wall.end)])
        column, row = _crossed(*(ends_m / canvas.cell_m)).T
        solid[row, column] = True
    x_m, y_m = _centres_m(canvas)
    for cylinder in contour.cylinders:
        reach_m = max(cylinder.radius_m, 0.71 * canvas.cell_m)  # a small one has a cell at least
        solid |= np.hypot(x_m - cylinder.x_m, y_m - cylinder.y_m) <= reach_m
    return solid


def _open_to(places_m: np.ndarray, solid: np.ndarray, canvas: OccupancyMap) -> np.ndarray:
    """Which cells can be got to from ``places_m`` and not through a ``solid`` one; all where no place is on the map."""
    region = np.zeros(solid.shape, np.int32)
    ndimage.label(~solid, output=region)  # cells that share a side are of one region
    column, row = np.floor((places_m - (canvas.x_m, canvas.y_m)) / canvas.cell_m).astype(int).T
    on_map = (row >= 0) & (row < solid.shape[0]) & (column >= 0) & (column < solid.shape[1])
    regions = np.setdiff1d(region[row[on_map], column[on_map]], 0)  # 0 is the solid cells
    return np.isin(region, regions) if len(regions) else np.ones_like(solid)


def _crossed(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Numbers (column, row) of every unit cell that the line between two points crosses, (cells, 2): from where it
    crosses a border of cells to where it crosses the next it lies in one of them.
    """
    shares = [np.array([0.0, 1.0])]
    for low, high, first, length in zip(
        np.minimum(start, end), np.maximum(start, end), start, end - start, strict=True
    ):
        if length:
            shares.append((np.arange(np.ceil(low), np.floor(high) + 1) - first) / length)
    borders = np.unique(np.clip(np.concatenate(shares), 0, 1))
    middles = (borders[:-1] + borders[1:]) / 2
    return np.floor(start + middles[:, None] * (end - start)).astype(int)


def _centres_m(canvas: OccupancyMap) -> tuple[np.ndarray, np.ndarray]:
    """x of the columns' centres, (1, columns), and y of the rows', (rows, 1)."""
    rows, columns = canvas.states.shape
    x_m = canvas.x_m + (np.arange(columns) + 0.5) * canvas.cell_m
    return x_m[None, :], (canvas.y_m + (np.arange(rows) + 0.5) * canvas.cell_m)[:, None]


def _inside(points_m: np.ndarray, x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Which (x, y) lie in the polygon: a ray to the right crosses its sides an odd number of times."""
    inside = np.zeros(np.broadcast_shapes(x_m.shape, y_m.shape), bool)
    for (ax, ay), (bx, by) in zip(points_m, np.roll(points_m, -1, axis=0), strict=True):
        crosses = (ay > y_m) != (by > y_m)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x_m < ax + (y_m - ay) * (bx - ax) / (by - ay))
    return inside
