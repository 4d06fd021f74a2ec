"""Feature points: cells that hang together are a cluster, and its most reliable cell is where a reflector was touched
(Section III.D).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from noctule_mapper.config import FeatureConfig
from noctule_mapper.contacts import Contacts, Kind
from noctule_mapper.echoes import Echoes
from noctule_mapper.grid import GridTile

_EIGHT_NEIGHBOURS = np.ones((3, 3), int)


@dataclass(frozen=True)
class FeaturePoints:
    """Arrays (n,): place, m(occupied) of the most reliable cell, the Kind of most contacts about it, the direction they
    were heard in.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    reliability: np.ndarray
    kind: np.ndarray
    direction_rad: np.ndarray

    def take(self, index: np.ndarray) -> "FeaturePoints":
        """The points at ``index`` (numbers or a mask)."""
        return FeaturePoints(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})


def feature_points(tiles: Sequence[GridTile], echoes: Echoes, found: Contacts, config: FeatureConfig) -> FeaturePoints:
    """The feature points of the grid, each placed at the mean of the contacts about its most reliable cell.

    A cluster longer than a block is cut along the blocks: on a wall walked along closely the clusters grow together,
    and one point for all of it would say nothing of its direction.
    """
    touching = found.kind != Kind.NONE
    heard = found.direction_rad[touching]
    x = echoes.x_m[touching] + echoes.range_m[touching] * np.cos(heard)
    y = echoes.y_m[touching] + echoes.range_m[touching] * np.sin(heard)
    touches = _Touches(x, y, heard, found.kind[touching])
    return _joined([_points_of(group, touches, config) for group in _adjacent(tiles)])


@dataclass(frozen=True)
class _Touches:
    """Contacts as places, arrays (n,)."""

    x_m: np.ndarray
    y_m: np.ndarray
    direction_rad: np.ndarray
    kind: np.ndarray


def _points_of(tiles: Sequence[GridTile], touches: _Touches, config: FeatureConfig) -> FeaturePoints:
    """The feature points of tiles that lie together, laid out as one array."""
    occupied, first_column, first_row = _mosaic(tiles)
    cell_m = tiles[0].cell_m
    label = np.zeros(occupied.shape, np.int32)
    ndimage.label(occupied > config.least_occupied, structure=_EIGHT_NEIGHBOURS, output=label)
    column = np.floor(touches.x_m / cell_m).astype(int) - first_column
    row = np.floor(touches.y_m / cell_m).astype(int) - first_row
    inside = np.nonzero((column >= 0) & (column < occupied.shape[1]) & (row >= 0) & (row < occupied.shape[0]))[0]
    inside = inside[label[row[inside], column[inside]] > 0]
    column, row, heard = column[inside], row[inside], touches.direction_rad[inside]
    block = max(1, round(config.block_m / cell_m))
    members = np.stack([label[row, column], row // block, column // block, touches.kind[inside]], axis=1)
    groups, which = np.unique(members, axis=0, return_inverse=True)
    groups, which = groups.reshape(-1, 4), which.reshape(-1)
    weight = occupied[row, column]
    reliability = np.zeros(len(groups))
    np.maximum.at(reliability, which, weight)
    total = np.bincount(which, weight)
    points = FeaturePoints(
        np.bincount(which, weight * touches.x_m[inside]) / total,
        np.bincount(which, weight * touches.y_m[inside]) / total,
        reliability,
        groups[:, 3],
        np.arctan2(np.bincount(which, np.sin(heard)), np.bincount(which, np.cos(heard))),
    )
    return points.take(_majority(groups[:, :3], np.bincount(which)))


def _joined(parts: Sequence[FeaturePoints]) -> FeaturePoints:
    """Several sets of points as one, in their order."""
    none = FeaturePoints(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, int), np.zeros(0))
    names = FeaturePoints.__dataclass_fields__
    return FeaturePoints(**{name: np.concatenate([getattr(part, name) for part in (none, *parts)]) for name in names})


def _adjacent(tiles: Sequence[GridTile]) -> Iterator[list[GridTile]]:
    """The tiles in groups that touch, also by a corner: between two groups may lie any distance, and no cluster."""
    left = {(tile.tile_x, tile.tile_y): tile for tile in tiles}
    while left:
        reached = [next(iter(left))]
        group = [left.pop(reached[0])]
        while reached:
            x, y = reached.pop()
            for beside in ((x + across, y + up) for across in (-1, 0, 1) for up in (-1, 0, 1)):
                if beside in left:
                    group.append(left.pop(beside))
                    reached.append(beside)
        yield group


def _majority(places: np.ndarray, count: np.ndarray) -> np.ndarray:
    """Of the groups at one place the largest, as row numbers."""
    order = np.lexsort((-count, *places.T[::-1]))
    first = np.ones(len(order), bool)
    first[1:] = np.any(np.diff(places[order], axis=0), axis=1)
    return np.sort(order[first])


def _mosaic(tiles: Sequence[GridTile]) -> tuple[np.ndarray, int, int]:
    """m(occupied) of all tiles as one array, and the site's column and row number of its first cell."""
    size = tiles[0].occupied.shape[0]
    keys = np.array([(tile.tile_x, tile.tile_y) for tile in tiles])
    first, last = keys.min(axis=0), keys.max(axis=0)
    columns, rows = (last - first + 1) * size
    occupied = np.zeros((rows, columns), np.float32)
    for tile in tiles:
        column, row = (tile.tile_x - first[0]) * size, (tile.tile_y - first[1]) * size
        occupied[row : row + size, column : column + size] = tile.occupied
    return occupied, int(first[0]) * size, int(first[1]) * size
