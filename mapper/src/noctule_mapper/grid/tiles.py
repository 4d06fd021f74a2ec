"""Where the grid's evidence is kept: tiles that exist while there is evidence in them, in arrays that all tiles share.

Nearly all that is said of a cell is that it is free, at one of a few levels: of that a cell keeps counts. Only a cell
that an arc touches has a row of sums. Both are exact enough to take evidence out again, and a cell takes few bytes.

A tile has a slot, its place in the arrays. The kernels find it in the window, a table of the slots about the newest
evidence, and take spare slots for new tiles themselves: so a stroke that stays inside the window costs one call.

Counts are fresh first, in one array for all cells of the window, and settle in their tiles when a tile is looked at,
when the window moves, and before they could run over.
"""

import math
from collections.abc import Callable, Iterator

import numpy as np

from noctule_mapper.fusion.sensor_model import FREE_LEVELS
from noctule_mapper.grid.polar_cells import MOST_TABLES, cells_by_sector

Key = tuple[int, int]
Box = tuple[int, int, int, int, int]  # least column and row, greatest column and row, reach of one piece of evidence

_MOST_COUNT = np.iinfo(np.uint16).max  # in 16 bits
_MARGIN_TILES = 4  # of a new window beyond what is needed now
_BESIDE_CELLS = 8  # of a row of fresh counts, so that rows are no power of two apart, which caches like least
_WIDEST_CELLS = 1 << 13  # from one to another in a stroke
_MOST_ARC_CELLS = 1 << 15  # in a stroke of arcs
_LEAST_REACH = 128  # of a table of sectors


class Tiles:
    """Square tiles of ``side`` cells; ``terms`` (levels, width) are those of the arcs' beliefs."""

    def __init__(self, side: int, cell_m: float, terms: np.ndarray) -> None:
        from noctule_mapper.grid import geometry, kernels  # loads Numba, which only a grid that is made should cost

        self._kernels, self._geometry = kernels, geometry
        self._side, self._cell_m, self._terms = side, cell_m, np.ascontiguousarray(terms, np.float32)
        self._stamp = 0  # number of the newest stroke
        self._asked = 0  # the newest that ``touched`` has told of
        self._told: set[Key] = set()  # tiles that it has told hold evidence
        self._gone: set[Key] = set()  # tiles that have lost their slot since
        # The window's corner, how many slots and rows are spare, the number of the newest fan: the cones of a sweep.
        self._state = np.zeros(kernels.STATES, np.int64)
        self._window = np.zeros((0, 0), np.int32)  # slots of the tiles from the corner on, -1 for none
        self._spare = np.zeros(0, np.int32)  # slots
        # Of each slot the tile's column and row, the pieces of evidence that have settled in it, the numbers of the
        # newest stroke and of the newest fan of cones that may have touched it, and how many strokes its fresh counts
        # may hold.
        self._slots = np.zeros((0, kernels.FIELDS), np.int64)
        self._reach_of: dict[int, int] = {}  # of the table in use for so many sectors
        self._arrays_of: dict[int, tuple[object, ...]] = {}  # with which cones of so many sectors are counted lately
        # How often a cell was called free is the sum of ``counts`` and of the lanes of ``fresh``, eight bits for each
        # level: all levels of a cell take one addition.
        self._fresh = np.zeros((0, 0), np.uint64)
        self._counts = np.zeros((0, side * side, FREE_LEVELS), np.uint16)
        self._highest = 0  # no count is above it
        self._rows = np.zeros((0, side * side), np.int32)  # of a cell in ``sums``, 0 for none
        self._spare_rows = np.zeros(1, np.int32)
        self._held = np.zeros(1, np.int32)  # beliefs in a row
        self._sums = np.zeros((1, terms.shape[1]), np.float32)

    def count_sweep(self, beams: tuple[object, ...], readings: int, sectors: int, sign: int) -> bool:
        """Count the cones of a sweep in (``sign`` 1) or out (-1): ``beams`` are the arguments of the function of that
        name in ``geometry``. Whether there was room for it: where not, nothing is done.
        """
        if sign > 0:
            self._reserve_counts(readings)
        arrays = self._arrays_of.get(sectors) or self._arrays_to_count(sectors)
        self._stamp += 1
        return self._kernels.SWEEP_OF_COUNTS[self._counts.dtype](*beams, *arrays, sign, self._stamp)

    def count_cones(self, cones: np.ndarray, sectors: int, sign: int) -> None:
        """Count cones (n, 8) in (``sign`` 1) or out (-1), as in ``stroke_cones``."""
        if sign > 0:
            self._reserve_counts(len(cones))
        cones = np.ascontiguousarray(cones, float)
        if not self._stroke_cones(cones, sectors, sign):
            for part, box in _parts(cones, self._geometry.cone_box):
                self._make_room(box, len(part))
                least = max(_LEAST_REACH, 1 << box[4].bit_length())
                self._reach_of[sectors] = max(least, self._reach_of.get(sectors, 0))
                self._stroke_cones(part, sectors, sign)

    def _stroke_cones(self, cones: np.ndarray, sectors: int, sign: int) -> bool:
        self._stamp += 1
        arrays = self._arrays_to_count(sectors)
        return self._kernels.CONES_OF_COUNTS[self._counts.dtype](cones, *arrays, sign, self._stamp)

    def _arrays_to_count(self, sectors: int) -> tuple[object, ...]:
        """What the kernels count cones with, kept until one of the arrays is replaced."""
        self._arrays_of.pop(sectors, None)
        if len(self._arrays_of) == MOST_TABLES:
            del self._arrays_of[next(iter(self._arrays_of))]
        reach = self._reach_of.get(sectors, _LEAST_REACH)
        cells, rings = cells_by_sector(reach, sectors, self._fresh.shape[1])
        tiles = self._state, self._window, self._slots, self._spare
        self._arrays_of[sectors] = cells, rings, reach, *tiles, self._fresh, self._counts, self._side
        return self._arrays_of[sectors]

    def _replaced(self) -> None:
        """Forget what cones were counted with. After an array is replaced the kernels must not get the old one."""
        self._arrays_of.clear()

    def add_contacts(self, contacts: tuple[object, ...], sign: int) -> bool:
        """Add (``sign`` 1) or take off (-1) the arcs of contacts: the arguments of ``geometry.contact_arcs`` but for
        ``cell_m``. Whether there was room for it: where not, nothing is done.
        """
        return self._kernels.CONTACTS(*contacts, *self._to_add(sign))

    def add_arcs(self, arcs: np.ndarray, sign: int) -> None:
        """Add (``sign`` 1) or take off (-1) arcs (n, 5), as in ``stroke_arcs``."""
        arcs = np.ascontiguousarray(arcs, float)
        if not self._stroke_arcs(arcs, sign):
            for part, box in _parts(arcs, lambda table: self._geometry.arc_box(table, self._cell_m), _MOST_ARC_CELLS):
                self._make_room(box, len(part))
                self._reserve_rows(self._kernels.most_arc_cells(len(part), box[4]))
                self._stroke_arcs(part, sign)

    def _stroke_arcs(self, arcs: np.ndarray, sign: int) -> bool:
        return self._kernels.ARCS(arcs, *self._to_add(sign))

    def _to_add(self, sign: int) -> tuple[object, ...]:
        """What the kernels need to add the arcs of a new stroke."""
        self._stamp += 1
        tiles = self._state, self._window, self._slots, self._spare
        rows = self._rows, self._spare_rows, self._held, self._sums, self._terms
        return self._cell_m, *tiles, *rows, self._side, sign, self._stamp

    def slots(self) -> dict[Key, int]:
        """The tiles that hold evidence, and their slots."""
        self._settle()
        return self._by_key(self._pieces() > 0)

    def more_than(self, most: int) -> bool:
        """Whether more tiles than ``most`` hold evidence. No tile without a slot does, and to count those with one is
        cheap.
        """
        if len(self._slots) - self._state[self._kernels.SPARE_SLOTS] <= most:
            return False
        self._settle()
        return bool(np.count_nonzero(self._pieces()) > most)

    def touched(self) -> dict[Key, int | None]:
        """The tiles that hold evidence and were touched since this was last asked, and their slots; None for those told
        of before that hold nothing any more.
        """
        self._settle()
        lately = self._slots[:, self._kernels.STAMP] > self._asked
        held = self._by_key(lately & (self._pieces() > 0))
        emptied = self._told & (self._gone | self._by_key(lately & (self._pieces() == 0)).keys()) - held.keys()
        self._told = self._told - emptied | held.keys()
        self._gone, self._asked = set(), self._stamp
        return {**dict.fromkeys(emptied), **held}

    def stamp(self, slot: int) -> int:
        """The number of the newest stroke that touched the tile: what was made of it then is still right."""
        return int(self._slots[slot, self._kernels.STAMP])

    def counts(self, slot: int) -> np.ndarray:
        """How often each cell was called free, (cells, levels); as floats."""
        self._settle()
        return self._counts[slot].astype(float)

    def sums(self, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """The cells that arcs touch, (n,), and their sums, (n, width)."""
        touched = np.flatnonzero(self._rows[slot])
        return touched, self._sums[self._rows[slot, touched]]

    def _settle(self) -> None:
        self._kernels.settle_all(self._state, self._slots, self._fresh, self._counts, self._side)

    def _pieces(self) -> np.ndarray:
        return self._slots[:, self._kernels.PIECES]

    def _by_key(self, chosen: np.ndarray) -> dict[Key, int]:
        slots = np.flatnonzero(chosen)
        keys = self._slots[slots][:, [self._kernels.COLUMN, self._kernels.ROW]]
        return {(column, row): slot for (column, row), slot in zip(keys.tolist(), slots.tolist(), strict=True)}

    def _make_room(self, box: Box, strokes: int) -> None:
        """Let the window hold ``box`` and have spare slots for the tiles that so many strokes may touch."""
        if self._kernels.has_room(box, strokes, self._state, self._window, self._side):
            return
        self._settle()
        self._collect()
        needed = self._kernels.most_tiles(box, strokes, self._side)
        if self._state[self._kernels.SPARE_SLOTS] < needed:
            self._add_slots(needed)
        least, most = (np.array(cells) // self._side for cells in (box[:2], box[2:4]))
        self._look_at(least - _MARGIN_TILES, most + _MARGIN_TILES)

    def _collect(self) -> None:
        """Make slots spare whose tiles hold nothing any more."""
        stamp, empty = self._kernels.STAMP, self._pieces() == 0
        self._gone.update(self._by_key(empty & (self._slots[:, stamp] > self._asked)))
        self._slots[empty, stamp] = 0
        spare = np.flatnonzero(empty)[::-1]
        self._spare[: len(spare)], self._state[self._kernels.SPARE_SLOTS] = spare, len(spare)

    def _add_slots(self, needed: int) -> None:
        before = len(self._slots)
        used = int(np.flatnonzero(self._pieces()).max(initial=-1)) + 1
        length = before + max(needed, before)
        self._slots, self._counts, self._rows = (
            _grown(array, used, length) for array in (self._slots, self._counts, self._rows)
        )
        self._spare = np.zeros(length, np.int32)
        self._replaced()
        self._collect()

    def _look_at(self, least: np.ndarray, most: np.ndarray) -> None:
        """Lay the window over the tiles from one (column, row) to another."""
        kernels, size = self._kernels, most - least + 1
        self._state[[kernels.CORNER_COLUMN, kernels.CORNER_ROW]] = least
        self._window = np.full(size[::-1], -1, np.int32)
        columns, rows = (size * self._side).tolist()
        self._fresh = np.zeros((rows, columns + _BESIDE_CELLS), np.uint64)
        self._replaced()
        place = self._slots[:, [kernels.COLUMN, kernels.ROW]] - least
        slots = np.flatnonzero((self._pieces() > 0) & np.all((place >= 0) & (place < size), axis=1))
        self._window[place[slots, 1], place[slots, 0]] = slots

    def _reserve_counts(self, more: int) -> None:
        """Let counts of 16 bits become 32 bits wide before one could run over."""
        self._highest += more
        if self._highest > _MOST_COUNT and self._counts.dtype == np.uint16:
            self._highest = int(self._counts.max(initial=0)) + self._kernels.MOST_STROKES + more
            if self._highest > _MOST_COUNT:
                self._counts = self._counts.astype(np.uint32)
                self._replaced()

    def _reserve_rows(self, needed: int) -> None:
        left = int(self._state[self._kernels.SPARE_ROWS])
        if left < needed:
            before = len(self._held)
            length = before + max(needed, before)
            self._sums, self._held, self._spare_rows = (
                _grown(array, before, length) for array in (self._sums, self._held, self._spare_rows)
            )
            kept, new = self._spare_rows[:left].copy(), np.arange(before, length, dtype=np.int32)[::-1]
            self._spare_rows[: len(new)], self._spare_rows[len(new) : len(new) + left] = new, kept
            self._state[self._kernels.SPARE_ROWS] += len(new)


def _grown(array: np.ndarray, used: int, length: int) -> np.ndarray:
    """The first ``used`` entries, then zeros up to ``length``: memory that nobody writes to is not taken."""
    grown = np.zeros((length, *array.shape[1:]), array.dtype)
    grown[:used] = array[:used]
    return grown


def _parts(
    table: np.ndarray, box_of: Callable[[np.ndarray], Box], most_cells: float = math.inf
) -> Iterator[tuple[np.ndarray, Box]]:
    """``table`` (n, columns) in parts for one stroke each, with their boxes: near one another and not too many."""
    box = box_of(table)
    near = max(box[2] - box[0], box[3] - box[1]) - 2 * box[4] <= _WIDEST_CELLS
    if len(table) == 1 or (near and len(table) * (2 * box[4] + 1) ** 2 <= most_cells):
        yield table, box
    else:
        half = len(table) // 2
        yield from _parts(table[:half], box_of, most_cells)
        yield from _parts(table[half:], box_of, most_cells)
