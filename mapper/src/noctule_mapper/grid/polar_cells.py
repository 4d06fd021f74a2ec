"""In which direction from a sensor each cell about it lies, so that no angle is worked out where cells are counted."""

from functools import lru_cache

import numpy as np

MOST_TABLES = 4  # that are kept
_RINGS = 256


@lru_cache(MOST_TABLES)  # a table takes 1.6 MB by default, and 16 times that at a quarter of the cells' size
def cells_by_sector(reach: int, sectors: int, wide: int) -> tuple[np.ndarray, np.ndarray]:
    """The cells within ``reach`` of the sensor's, sector by sector and in each by rising distance: int32 (2, cells),
    how far a cell lies from the sensor's in an array ``wide`` columns wide, and the square of its distance. And int32
    (rings + 2, sectors): where a sector begins among them, then where its part within each ring ends, from radius 0 to
    ``reach`` in equal steps.

    Of the circle's ``sectors`` parts sector k has the directions from k to k + 1; the sensor's own cell is in sector 0.
    """
    row, column, rings = _places(reach, sectors)
    return np.stack([row * wide + column, row * row + column * column]), rings


@lru_cache(maxsize=2)
def _places(reach: int, sectors: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Their rows and columns against the sensor's, int32 (cells,), and the rings."""
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1).astype(np.int32)
    square = row * row + column * column
    inside = square <= reach * reach
    row, column, square = row[inside], column[inside], square[inside]
    sector = np.floor(np.arctan2(row, column) / (2 * np.pi) * sectors).astype(np.int64) % sectors
    key = sector * (reach * reach + 1) + square
    order = np.argsort(key)
    squares = np.concatenate([[-1], np.floor((np.arange(_RINGS + 1) * reach / _RINGS) ** 2)]).astype(np.int64)
    ends = np.arange(sectors)[:, None] * (reach * reach + 1) + squares  # rising, so that each search begins at the last
    rings = np.searchsorted(key[order], ends, side="right").T
    return row[order], column[order], np.ascontiguousarray(rings, np.int32)
