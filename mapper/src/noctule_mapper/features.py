"""Feature points: cells that hang together are a cluster, and its most reliable cell is where a reflector was touched
(Section III.D).
"""

from collections.abc import Sequence
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
    if not tiles or not len(echoes):
        return FeaturePoints(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, int), np.zeros(0))
    occupied, first_column, first_row = _mosaic(tiles)
    cell_m = tiles[0].cell_m
    label = np.zeros(occupied.shape, np.int32)
    ndimage.label(occupied > config.least_occupied, structure=_EIGHT_NEIGHBOURS, output=label)
    touching = found.kind != Kind.NONE
    x = echoes.x_m[touching] + echoes.range_m[touching] * np.cos(found.direction_rad[touching])
    y = echoes.y_m[touching] + echoes.range_m[touching] * np.sin(found.direction_rad[touching])
    column, row = np.floor(x / cell_m).astype(int) - first_column, np.floor(y / cell_m).astype(int) - first_row
    clustered = label[row, column]
    block = max(1, round(config.block_m / cell_m))
    members = np.stack([clustered, row // block, column // block, found.kind[touching]], axis=1)
    inside = clustered > 0
    groups, which = np.unique(members[inside], axis=0, return_inverse=True)
    count = np.bincount(which)
    reliability = np.zeros(len(groups))
    np.maximum.at(reliability, which, occupied[row[inside], column[inside]])
    weight = occupied[row[inside], column[inside]]
    total = np.bincount(which, weight)
    heard = found.direction_rad[touching][inside]
    direction = np.arctan2(np.bincount(which, np.sin(heard)), np.bincount(which, np.cos(heard)))
    groups = groups.reshape(-1, 4)
    kept = _majority(groups[:, :3], count)
    return FeaturePoints(
        (np.bincount(which, weight * x[inside]) / total)[kept],
        (np.bincount(which, weight * y[inside]) / total)[kept],
        reliability[kept],
        groups[kept, 3],
        direction[kept],
    )


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
