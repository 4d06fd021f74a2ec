"""The reliability grid: square tiles of cells, each cell with the evidence of all readings that speak of it."""

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache

import numpy as np

from noctule_mapper.choices import Rule
from noctule_mapper.config import GridConfig
from noctule_mapper.contacts.voting import Contacts
from noctule_mapper.fusion.sensor_model import FREE_LEVELS, arc_beliefs, free_beliefs
from noctule_mapper.fusion.streams import stream
from noctule_mapper.grid.pcr5_fold import folded_pcr5
from noctule_mapper.grid.regions import Arcs, Cones, beams_of, contact_regions, free_space, touched_by
from noctule_mapper.grid.tiles import Key, Tiles
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.sweep import SweepReadings

_SECTORS_PER_BEAM = 16
_NARROWEST_BEAM_RAD = math.radians(0.1)  # that the sectors follow
_ROUNDING = 0.01  # of the power: a width of just a sixteenth of a turn is one also where its last digit is not


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


@lru_cache
def _sectors(width_rad: float) -> int:
    """Of a circle about a sensor, a power of two: sensors of nearly one width share their table."""
    needed = 2 * math.pi / max(width_rad, _NARROWEST_BEAM_RAD) * _SECTORS_PER_BEAM
    return 1 << math.ceil(math.log2(needed) - _ROUNDING)


def cell_states(occupied: np.ndarray, free: np.ndarray, config: GridConfig) -> np.ndarray:
    """What cells with these beliefs are taken for: CellState as uint8, of the beliefs' shape. Occupied goes first."""
    state = np.where(free >= config.free_from, CellState.FREE, CellState.UNKNOWN)
    return np.where(occupied >= config.occupied_from, CellState.OCCUPIED, state).astype(np.uint8)


class Grid:
    """Sparse: a tile exists while there is evidence in it. Evidence may be taken out again in any order."""

    def __init__(self, config: GridConfig, rule: Rule = "pcr6+") -> None:
        beliefs = np.concatenate([free_beliefs(config.most_free), arc_beliefs(config.most_occupied)])
        self.cell_m = config.cell_m
        self._config = config
        self.tile_size = config.tile_cells
        self._fusion = folded_pcr5(beliefs) if rule == "pcr5" else stream(rule, config.nodes)
        self._free_terms, arc_terms = np.split(self._fusion.terms(beliefs), [FREE_LEVELS])
        self._free_log_unknown = np.log(beliefs[:FREE_LEVELS, 2])
        self._tiles = Tiles(config.tile_cells, config.cell_m, arc_terms.astype(np.float32))
        self._beliefs: dict[Key, tuple[int, GridTile]] = {}  # and the number of the stroke that they are made of

    def add_sweep(self, sweep: SweepReadings, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) the space before a sweep's arcs: ``free_space`` of it, in one call."""
        beams = beams_of(sweep, self._config)
        if not self._tiles.count_sweep(beams, len(sweep.range_m), _sectors(sweep.beam_width_rad), sign):
            self.add_free(free_space(sweep, self._config), sign)

    def add_contacts(self, echoes: Echoes, found: Contacts, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) what echoes touched: ``contact_regions`` of them, in one call."""
        if len(echoes) and not self._tiles.add_contacts(touched_by(echoes, found, self._config), sign):
            self.add(contact_regions(echoes, found, self._config), sign)

    def add_free(self, cones: Cones, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) the space before arcs; beams of one width."""
        if len(cones.table):
            self._tiles.count_cones(cones.table, _sectors(float(cones.table[0, 6])), sign)

    def add(self, arcs: Arcs, sign: int = 1) -> None:
        """Put in (sign 1) or take out (sign -1) contact regions."""
        if len(arcs.table):
            self._tiles.add_arcs(arcs.table, sign)

    def has_more_tiles_than(self, most: int) -> bool:
        """Whether more tiles than ``most`` hold evidence."""
        return self._tiles.more_than(most)

    def changed(self) -> list[GridTile]:
        """Tiles touched since this was last asked; one that has lost all its evidence comes as all unknown."""
        return [self._tile(key, slot) for key, slot in sorted(self._tiles.touched().items())]

    def tiles(self) -> list[GridTile]:
        """All tiles that hold evidence."""
        return [self._tile(key, slot) for key, slot in sorted(self._tiles.slots().items())]

    def _tile(self, key: Key, slot: int | None) -> GridTile:
        """The tile, worked out once as long as there is evidence in it and no more comes."""
        stamp, known = self._beliefs.get(key, (-1, None))
        if known is not None and slot is not None and stamp >= self._tiles.stamp(slot):
            return known
        side_m, shape = self.tile_size * self.cell_m, (self.tile_size, self.tile_size)
        occupied, free = np.zeros((2, *shape), np.float32)
        tile = GridTile(*key, key[0] * side_m, key[1] * side_m, self.cell_m, occupied, free)
        if slot is None:
            self._beliefs.pop(key, None)
        else:
            self._fill(slot, occupied.reshape(-1), free.reshape(-1))
            self._beliefs[key] = self._tiles.stamp(slot), tile
        return tile

    def _fill(self, slot: int, occupied: np.ndarray, free: np.ndarray) -> None:
        """The tile's beliefs into ``occupied`` and ``free``, (cells,). Free space alone is in no conflict with itself:
        by every rule m(free) is 1 less the product of the unknown.
        """
        counts = self._tiles.counts(slot)
        free[:] = 1 - np.exp(counts @ self._free_log_unknown)
        touched, sums = self._tiles.sums(slot)
        if len(touched):
            fused = self._fusion.belief(sums + counts[touched] @ self._free_terms)
            occupied[touched], free[touched] = fused[:, 0], fused[:, 1]
