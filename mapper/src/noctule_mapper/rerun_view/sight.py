"""What units can see from their places: a beam is wider than a gap, so that the grid's free space spills past corners.

The grid itself stays as it was fused. Only the picture of its free space ends at the walls.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from noctule.messages_pb2 import Contour, GridTile

_RAYS = 360
_FARTHEST_M = 20.0  # beyond a sensor's range
_WALL_ENDS_M = 0.03  # walls that meet leave gaps as wide as their errors
_BEYOND_CELLS = 0.5  # the cell in which a wall lies is part of the room
_PLACES_APART_M = 0.1
_MOST_PLACES = 60


@dataclass(frozen=True)
class Sight:
    """The outlines (places, rays, 2), in metres, of what is seen from each place."""

    outlines_m: np.ndarray

    def is_near(self, other: "Sight | None", within_m: float) -> bool:
        """Whether the two would cut a picture alike."""
        if other is None or other.outlines_m.shape != self.outlines_m.shape:
            return False
        return bool(np.percentile(np.abs(self.outlines_m - other.outlines_m), 95) < within_m)

    def cells(self, tile: GridTile) -> np.ndarray:
        """(rows, columns) bool: the tile's cells whose centres are seen from somewhere."""
        corner_m = np.array([tile.x_m, tile.y_m])
        pixels = (self.outlines_m - corner_m) / tile.cell_m - 0.5
        image = Image.new("1", (tile.columns, tile.rows))
        draw = ImageDraw.Draw(image)
        for outline in pixels:
            draw.polygon(outline.ravel().tolist(), fill=1)
        return np.array(image)


def sight(contour: Contour, places_m: Iterable[tuple[float, float]], cell_m: float) -> Sight | None:
    """What is seen from ``places_m`` within the walls of ``contour``; None where there is no wall or no place."""
    places = _apart(places_m)
    if not contour.walls or not len(places):
        return None
    starts = np.array([(wall.start.x_m, wall.start.y_m) for wall in contour.walls])
    ends = np.array([(wall.end.x_m, wall.end.y_m) for wall in contour.walls])
    along = (ends - starts) / np.maximum(np.linalg.norm(ends - starts, axis=1, keepdims=True), 1e-9)
    starts, ends = starts - _WALL_ENDS_M * along, ends + _WALL_ENDS_M * along
    turn_rad = np.linspace(0.0, 2 * np.pi, _RAYS, endpoint=False)
    rays = np.stack([np.cos(turn_rad), np.sin(turn_rad)], axis=1)
    ranges_m = [_ranges_m(place, rays, starts, ends) + _BEYOND_CELLS * cell_m for place in places]
    return Sight(np.stack([place + range_m[:, None] * rays for place, range_m in zip(places, ranges_m, strict=True)]))


def _ranges_m(place: np.ndarray, rays: np.ndarray, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(rays,) distances from ``place`` along ``rays`` (rays, 2) to the nearest wall from ``starts`` to ``ends``."""
    walls, to_start = ends - starts, starts - place
    across = _cross(rays[:, None], walls)  # (rays, walls)
    with np.errstate(divide="ignore", invalid="ignore"):
        range_m = _cross(to_start, walls) / across
        share = _cross(to_start[None], rays[:, None]) / across
    hits = (range_m > 0) & (share >= 0) & (share <= 1)
    return np.where(hits, range_m, _FARTHEST_M).min(axis=1)


def _cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def _apart(places_m: Iterable[tuple[float, float]]) -> np.ndarray:
    """(places, 2) in metres, one of those that stand together, the last ones if there are too many."""
    cells = {tuple(np.rint(np.divide(place, _PLACES_APART_M)).astype(int)): place for place in places_m}
    return np.reshape(list(cells.values())[-_MOST_PLACES:], (-1, 2))
