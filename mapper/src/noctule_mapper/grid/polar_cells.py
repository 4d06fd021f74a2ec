"""In which direction from a sensor each cell about it lies, so that no angle is worked out where cells are counted."""

from functools import lru_cache

import numpy as np


@lru_cache(maxsize=16)
def sectors_about(reach: int, sectors: int) -> np.ndarray:
    """The sector of each cell within ``reach`` rows and columns of the sensor's, uint16 (2 reach + 1, 2 reach + 1).

    Of the circle's ``sectors`` parts (65536 at most) sector k has the directions from k to k + 1; the sensor's own cell
    is in sector 0.
    """
    row, column = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return (np.floor(np.arctan2(row, column) / (2 * np.pi) * sectors).astype(int) % sectors).astype(np.uint16)
