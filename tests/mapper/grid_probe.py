"""Readings put into a grid by hand, and what the grid then says of a place."""

import numpy as np

from noctule_mapper.grid.grid import Grid, GridTile
from noctule_mapper.grid.regions import Arcs, Cones

WIDTH_RAD = np.radians(22.5)


def arcs(*lines: tuple[float, ...]) -> Arcs:
    """Contact regions: x_m, y_m, range_m, direction_rad, epsilon_m."""
    return Arcs(np.array(lines, float))


def cones(*lines: tuple[float, ...], width_rad: float = WIDTH_RAD) -> Cones:
    """Whole beams, each a sweep: column and row of the sensor's cell, axis_rad, reach in cells."""
    table = np.array(lines, float)
    axis, width = table[:, 2], np.full(len(table), width_rad)
    beam = np.stack([axis, axis - width / 2, axis + width / 2, table[:, 3], width, np.ones(len(table))], axis=1)
    return Cones(np.hstack([table[:, :2], beam]))


def at(grid: Grid, x_m: float, y_m: float) -> tuple[float, float]:
    """Occupied and free of the cell at a place."""
    for tile in grid.tiles():
        column, row = int((x_m - tile.x_m) // tile.cell_m), int((y_m - tile.y_m) // tile.cell_m)
        if 0 <= column < grid.tile_size and 0 <= row < grid.tile_size:
            return float(tile.occupied[row, column]), float(tile.free[row, column])
    return 0.0, 0.0


def centres(tile: GridTile) -> tuple[np.ndarray, np.ndarray]:
    """x_m (1, columns) and y_m (rows, 1) of the cells' centres."""
    middle = (np.arange(len(tile.free)) + 0.5) * tile.cell_m
    return tile.x_m + middle[None, :], tile.y_m + middle[:, None]


def beliefs_about(grid: Grid, column: int, row: int, reach: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Occupied and free, (n, n, 2), of the cells within ``reach`` of one, and how many columns and rows off they are;
    nothing is said of others.
    """
    size = 2 * reach + 1
    said, found = np.zeros((size, size, 2)), 0
    for tile in grid.tiles():
        left, low = tile.tile_x * grid.tile_size - column + reach, tile.tile_y * grid.tile_size - row + reach
        both = np.stack([tile.occupied, tile.free], axis=-1)
        inside = both[max(-low, 0) : max(size - low, 0), max(-left, 0) : max(size - left, 0)]
        rows, columns = inside.shape[:2]
        said[max(low, 0) : max(low, 0) + rows, max(left, 0) : max(left, 0) + columns] = inside
        found += np.count_nonzero(both)
    assert np.count_nonzero(said) == found
    dy, dx = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    return said, dx, dy
