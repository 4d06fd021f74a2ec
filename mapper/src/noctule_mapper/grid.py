"""The reliability grid: square tiles of cells, each cell with the PCR6+ evidence of all readings that speak of it."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from noctule_mapper.config import GridConfig
from noctule_mapper.fusion import Evidence, evidence

_FREE_LEVELS = 32  # beliefs in free space are rounded to these, so that their evidence is looked up


@dataclass(frozen=True)
class GridTile:
    """One tile's beliefs, float32 (rows, columns); row 0 has the lowest y, (x_m, y_m) is the lower left corner."""

    tile_x: int
    tile_y: int
    x_m: float
    y_m: float
    cell_m: float
    occupied: np.ndarray
    free: np.ndarray


@dataclass(frozen=True)
class CellMasses:
    """Beliefs about cells: (column, row) numbers of the site's grid, int (n, 2), and masses (n, 3). A cell may occur
    more than once.
    """

    cells: np.ndarray
    masses: np.ndarray


class _Tile:
    """Evidence of tile_cells^2 cells, row by row, one line per cell."""

    def __init__(self, cells: int, nodes: int) -> None:
        self.log_product = np.zeros((cells, nodes), np.float32)
        self.occupied_share = np.zeros((cells, nodes), np.float32)
        self.free_share = np.zeros((cells, nodes), np.float32)
        self.log_unknown = np.zeros(cells, np.float32)
        self.held = 0  # pieces of evidence put in and not taken out


class Grid:
    """Sparse: a tile exists while there is evidence in it. Evidence may be taken out again in any order."""

    def __init__(self, config: GridConfig) -> None:
        self.cell_m = config.cell_m
        self.tile_size = config.tile_cells
        self._nodes = config.nodes
        self._tiles: dict[tuple[int, int], _Tile] = {}
        self._changed: set[tuple[int, int]] = set()
        self._beliefs: dict[tuple[int, int], GridTile] = {}
        levels = np.linspace(0, config.most_free, _FREE_LEVELS, dtype=np.float32)
        self._most_free = config.most_free
        free = evidence(np.stack([np.zeros_like(levels), levels, 1 - levels], axis=-1), config.nodes)
        self._free = np.ascontiguousarray(free.log_product.T), np.ascontiguousarray(free.free_share.T), free.log_unknown

    def add_free(self, cells: np.ndarray, free: np.ndarray, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) beliefs in free space, (n,), of distinct ``cells``, int (n, 2)."""
        level = np.rint(free / self._most_free * (_FREE_LEVELS - 1)).astype(int)
        log_product, free_share, log_unknown = self._free
        for tile, chosen, inside in self._by_tile(cells, sign * np.ones(len(cells), int)):
            tile.log_product[inside] += sign * log_product[level[chosen]]
            tile.free_share[inside] += sign * free_share[level[chosen]]
            tile.log_unknown[inside] += sign * log_unknown[level[chosen]]

    def add(self, beliefs: CellMasses, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) beliefs, the same cell as often as it occurs."""
        if not len(beliefs.cells):
            return
        single = evidence(beliefs.masses.astype(np.float32), self._nodes)
        cells, which = np.unique(beliefs.cells, axis=0, return_inverse=True)
        log_product, occupied_share, free_share = (np.zeros((len(cells), self._nodes), np.float32) for _ in range(3))
        log_unknown = np.zeros(len(cells), np.float32)
        np.add.at(log_product, which, single.log_product.T)
        np.add.at(occupied_share, which, single.occupied_share.T)
        np.add.at(free_share, which, single.free_share.T)
        np.add.at(log_unknown, which, single.log_unknown)
        for tile, chosen, inside in self._by_tile(cells, sign * np.bincount(which)):
            tile.log_product[inside] += sign * log_product[chosen]
            tile.occupied_share[inside] += sign * occupied_share[chosen]
            tile.free_share[inside] += sign * free_share[chosen]
            tile.log_unknown[inside] += sign * log_unknown[chosen]

    def changed(self) -> list[GridTile]:
        """Tiles touched since this was last asked; one that has lost all its evidence comes as all unknown."""
        changed, self._changed = self._changed, set()
        return [self._tile(key) for key in sorted(changed)]

    def tiles(self) -> list[GridTile]:
        """All tiles that hold evidence."""
        return [self._tile(key) for key in sorted(self._tiles)]

    def _by_tile(self, cells: np.ndarray, pieces: np.ndarray) -> Iterator[tuple[_Tile, np.ndarray, np.ndarray]]:
        """Tile by tile: the tile, which of ``cells`` lie in it, and their line numbers there; ``pieces`` of evidence
        come or go with each.
        """
        tile_of = np.floor_divide(cells, self.tile_size)
        line = (
            (cells[:, 1] - tile_of[:, 1] * self.tile_size) * self.tile_size
            + cells[:, 0]
            - tile_of[:, 0] * self.tile_size
        )
        order = np.lexsort((tile_of[:, 0], tile_of[:, 1]))
        breaks = np.nonzero(np.any(np.diff(tile_of[order], axis=0), axis=1))[0] + 1
        for chosen in np.split(order, breaks) if len(order) else ():
            key = (int(tile_of[chosen[0], 0]), int(tile_of[chosen[0], 1]))
            tile = self._tiles.setdefault(key, _Tile(self.tile_size**2, self._nodes))
            yield tile, chosen, line[chosen]
            tile.held += int(pieces[chosen].sum())
            self._changed.add(key)
            self._beliefs.pop(key, None)
            if not tile.held:
                del self._tiles[key]

    def _tile(self, key: tuple[int, int]) -> GridTile:
        if key not in self._beliefs:
            shape = (self.tile_size, self.tile_size)
            tile = self._tiles.get(key)
            if tile is None:
                belief = np.zeros((*shape, 3), np.float32)
            else:
                state = Evidence(tile.log_product.T, tile.occupied_share.T, tile.free_share.T, tile.log_unknown)
                belief = state.belief().reshape(*shape, 3)
            side_m = self.tile_size * self.cell_m
            x_m, y_m = key[0] * side_m, key[1] * side_m
            self._beliefs[key] = GridTile(*key, x_m, y_m, self.cell_m, belief[..., 0], belief[..., 1])
        return self._beliefs[key]
