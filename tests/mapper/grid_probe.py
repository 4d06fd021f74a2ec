"""Readings put into a grid by hand, and what the grid then says of a place."""

import numpy as np

from noctule_mapper.grid.grid import Grid, GridTile
from noctule_mapper.grid.regions import Arcs, Cones

WIDTH_RAD = np.radians(22.5)


def arcs(*lines: tuple[float, ...]) -> Arcs:
    """Contact regions: x_m, y_m, range_m, direction_rad, epsilon_m."""
    return Arcs(np.array(lines, float))


def cones(*lines: tuple[float, ...]) -> Cones:
    """Whole beams of 22.5 degrees: column and row of the sensor's cell, axis_rad, reach in cells."""
    table = np.array(lines, float)
    half = np.full(len(table), WIDTH_RAD / 2)
    beam = np.stack([table[:, 2], table[:, 2] - half, table[:, 2] + half, table[:, 3], 2 * half], axis=1)
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
