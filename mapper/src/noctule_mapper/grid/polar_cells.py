"""The cells about a sensor, sorted into thin sectors and outwards in each, so that a cone is a few runs of a table."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np


@dataclass(frozen=True)
class Disc:
    """first (sectors + 1,): where each sector begins; step (n,): 2^16 rows + columns from the sensor's cell, uint32
    modulo 2^32; distance (n,): in cells. Sector k holds the directions from k to k + 1 parts of the circle.
    """

    first: np.ndarray
    step: np.ndarray
    distance: np.ndarray


@lru_cache(maxsize=16)
def disc(reach: int, sectors: int) -> Disc:
    """All cells whose centres lie within ``reach`` cells of the sensor's, itself included (in sector 0)."""
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1].reshape(2, -1)
    inside = column**2 + row**2 <= reach**2
    column, row = column[inside], row[inside]
    sector = np.floor(np.arctan2(row, column) / (2 * np.pi) * sectors).astype(int) % sectors
    distance = np.hypot(column, row)
    order = np.lexsort((distance, sector))
    first = np.searchsorted(sector[order], np.arange(sectors + 1))
    step = (row[order] << 16) + column[order]
    return Disc(first, (step & 0xFFFFFFFF).astype(np.uint32), distance[order])
