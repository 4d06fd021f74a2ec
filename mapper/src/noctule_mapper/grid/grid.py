"""The reliability grid: square tiles of cells, each cell with the evidence of all readings that speak of it."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from noctule_mapper.choices import Rule
from noctule_mapper.config import GridConfig
from noctule_mapper.fusion.levels import FREE_LEVELS, arc_beliefs, free_beliefs
from noctule_mapper.fusion.streams import stream
from noctule_mapper.grid.pcr5_fold import folded_pcr5
from noctule_mapper.grid.polar_cells import disc
from noctule_mapper.grid.regions import Arcs
from noctule_mapper.grid.tiles import Key, Tiles, arc_reach_cells

_SECTORS_PER_BEAM = 16
_MOST_AT_ONCE = 256  # cones or arcs in one stroke, and how far apart
_WIDEST_CELLS = 1 << 13
_NARROWEST_BEAM_RAD = math.radians(0.1)  # that the sectors of the table follow
_MOST_ARC_CELLS = 1 << 20  # looked at in one stroke of arcs


class CellState(IntEnum):
    """What a cell is taken for."""

    UNKNOWN = 0
    FREE = 1
    OCCUPIED = 2


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


def cell_states(occupied: np.ndarray, free: np.ndarray, config: GridConfig) -> np.ndarray:
    """What cells with these beliefs are taken for: CellState as uint8, of the beliefs' shape. Occupied goes first."""
    state = np.where(free >= config.free_from, CellState.FREE, CellState.UNKNOWN)
    return np.where(occupied >= config.occupied_from, CellState.OCCUPIED, state).astype(np.uint8)


class Grid:
    """Sparse: a tile exists while there is evidence in it. Evidence may be taken out again in any order."""

    def __init__(self, config: GridConfig, rule: Rule = "pcr6+") -> None:
        beliefs = np.concatenate([free_beliefs(config.most_free), arc_beliefs(config.most_occupied)])
        self.cell_m = config.cell_m
        self.tile_size = config.tile_cells
        self._fusion = folded_pcr5(beliefs) if rule == "pcr5" else stream(rule, config.nodes)
        self._free_terms, arc_terms = np.split(self._fusion.terms(beliefs), [FREE_LEVELS])
        self._free_log_unknown = np.log(beliefs[:FREE_LEVELS, 2])
        self._tiles = Tiles(config.tile_cells, arc_terms.astype(np.float32))
        self._changed: set[Key] = set()
        self._beliefs: dict[Key, GridTile] = {}

    def add_free(self, apex: np.ndarray, beam: np.ndarray, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) the space before arcs, as ``regions.free_space`` gives it; beams of one
        width.
        """
        for some in _parts(apex, _MOST_AT_ONCE):
            reach = 1 << int(beam[some, 3].max() + 1).bit_length()
            sectors = math.ceil(2 * np.pi / max(beam[some.start, 4], _NARROWEST_BEAM_RAD) * _SECTORS_PER_BEAM)
            self._touch(self._tiles.count_cones(apex[some], beam[some], disc(reach, sectors), sign))

    def add(self, arcs: Arcs, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) contact regions."""
        if not len(arcs.table):
            return
        most = min(_MOST_AT_ONCE, max(1, _MOST_ARC_CELLS // (2 * arc_reach_cells(arcs.table, self.cell_m) + 1) ** 2))
        for some in _parts(np.floor(arcs.table[:, :2] / self.cell_m), most):
            self._touch(self._tiles.add_arcs(arcs.table[some], self.cell_m, sign))

    def changed(self) -> list[GridTile]:
        """Tiles touched since this was last asked; one that has lost all its evidence comes as all unknown."""
        changed, self._changed = self._changed, set()
        return [self._tile(key) for key in sorted(changed)]

    def tiles(self) -> list[GridTile]:
        """All tiles that hold evidence."""
        return [self._tile(key) for key in sorted(self._tiles.slots)]

    def _touch(self, keys: list[Key]) -> None:
        self._changed.update(keys)
        for key in keys:
            self._beliefs.pop(key, None)

    def _tile(self, key: Key) -> GridTile:
        """The tile, worked out once as long as there is evidence in it and no more comes."""
        if key in self._beliefs:
            return self._beliefs[key]
        side_m, shape = self.tile_size * self.cell_m, (self.tile_size, self.tile_size)
        occupied, free = np.zeros((2, *shape), np.float32)
        tile = GridTile(*key, key[0] * side_m, key[1] * side_m, self.cell_m, occupied, free)
        if key in self._tiles.slots:
            self._fill(key, occupied.reshape(-1), free.reshape(-1))
            self._beliefs[key] = tile
        return tile

    def _fill(self, key: Key, occupied: np.ndarray, free: np.ndarray) -> None:
        """The tile's beliefs into ``occupied`` and ``free``, (cells,). Free space alone is in no conflict with itself:
        by every rule m(free) is 1 less the product of the unknown.
        """
        counts = self._tiles.counts(key)
        free[:] = 1 - np.exp(self._free_log_unknown @ counts)
        touched, sums = self._tiles.sums(key)
        if len(touched):
            fused = self._fusion.belief(sums + counts[:, touched].T @ self._free_terms)
            occupied[touched], free[touched] = fused[:, 0], fused[:, 1]


def _parts(cells: np.ndarray, most: int, first: int = 0) -> Iterator[slice]:
    """Slices of ``cells`` (n, 2) for one stroke each: ``most`` at once, and near one another."""
    if len(cells) > 1 and (len(cells) > most or np.ptp(cells, axis=0).max() > _WIDEST_CELLS):
        half = len(cells) // 2
        yield from _parts(cells[:half], most, first)
        yield from _parts(cells[half:], most, first + half)
    elif len(cells):
        yield slice(first, first + len(cells))
