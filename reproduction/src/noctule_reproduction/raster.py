"""Beliefs about cells as one picture with its place in the site's frame."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.grid.grid import GridTile


@dataclass(frozen=True)
class Raster:
    """Values (rows, columns) of cells; row 0 is lowest and bears the grid's number ``row``, column 0 ``column``."""

    column: int
    row: int
    cell_m: float
    values: np.ndarray

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top in metres, as matplotlib wants them."""
        rows, columns = self.values.shape
        left, right, bottom, top = self.column, self.column + columns, self.row, self.row + rows
        return left * self.cell_m, right * self.cell_m, bottom * self.cell_m, top * self.cell_m

    @property
    def centres(self) -> tuple[np.ndarray, np.ndarray]:
        """x and y of the cells' centres in metres, (rows, columns) each."""
        rows, columns = self.values.shape
        x, y = np.meshgrid(self.column + np.arange(columns) + 0.5, self.row + np.arange(rows) + 0.5)
        return x * self.cell_m, y * self.cell_m


def blank(low_m: tuple[float, float], high_m: tuple[float, float], cell_m: float) -> Raster:
    """Zeros from the corner ``low_m`` (x, y) to ``high_m``."""
    column, row = (int(np.floor(edge / cell_m)) for edge in low_m)
    columns, rows = int(np.ceil(high_m[0] / cell_m)) - column, int(np.ceil(high_m[1] / cell_m)) - row
    return Raster(column, row, cell_m, np.zeros((rows, columns)))


def painted(canvas: Raster, cells: np.ndarray, values: np.ndarray) -> Raster:
    """``canvas`` with the highest of ``values`` (n,) that each of the cells (column, row), int (n, 2), is given."""
    column, row = cells[:, 0] - canvas.column, cells[:, 1] - canvas.row
    rows, columns = canvas.values.shape
    inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    picture = canvas.values.copy()
    np.maximum.at(picture, (row[inside], column[inside]), values[inside])
    return replace(canvas, values=picture)


def tiled(canvas: Raster, tiles: Sequence[GridTile], name: str) -> Raster:
    """``canvas`` with the beliefs ``name``, occupied or free, of tiles of the same cells; of several in one place the
    highest.
    """
    for tile in tiles:
        size = tile.occupied.shape[0]
        row, column = np.nonzero(getattr(tile, name))
        cells = np.stack([tile.tile_x * size + column, tile.tile_y * size + row], axis=1)
        canvas = painted(canvas, cells, getattr(tile, name)[row, column])
    return canvas
