"""Where the grid's evidence is kept: tiles that exist while there is evidence in them, in arrays that all tiles share.

Nearly all that is said of a cell is that it is free, at one of a few levels: of that a cell keeps counts. Only a cell
that an arc touches has a row of sums. Both are exact enough to take evidence out again, and a cell takes few bytes.

A tile has a slot, its place in the arrays. The kernels find it in the window, a table of the slots about the newest
evidence, and take spare slots for new tiles themselves: so a stroke that stays inside the window costs one call.
"""

import numpy as np

from noctule_mapper.fusion.sensor_model import FREE_LEVELS
from noctule_mapper.grid.polar_cells import sectors_about

Key = tuple[int, int]
Box = tuple[int, int, int, int, int]  # least column and row, greatest column and row, reach of one piece of evidence

_NO_TILES = (0, 0, -1, -1)
_MOST_COUNT = np.iinfo(np.uint16).max  # in 16 bits
_MARGIN_TILES = 8  # of a new window beyond what is needed now


class Tiles:
    """Square tiles of ``side`` cells; ``terms`` (levels, width) are those of the arcs' beliefs."""

    def __init__(self, side: int, terms: np.ndarray) -> None:
        from noctule_mapper.grid import kernels  # loads Numba, which only a grid that is made should cost

        self._kernels = kernels
        self._side, self._terms = side, terms
        self._stamp = 0  # number of the newest stroke
        self._asked = 0  # the newest that ``touched`` has told of
        self._gone: set[Key] = set()  # tiles that have lost their slot since
        self._covered = _NO_TILES  # by the window: least column and row, greatest column and row, in tiles
        self._corner = np.zeros(2, np.int64)
        self._window = np.zeros((0, 0), np.int32)  # slots, -1 for none
        self._left = np.zeros(2, np.int64)  # how many spare slots there are, and how many spare rows
        self._spare = np.zeros(0, np.int32)
        self._keys = np.zeros((0, 2), np.int64)  # column and row of the tile
        self._pieces = np.zeros(0, np.int64)  # of evidence in the tile
        self._stamps = np.zeros(0, np.int64)  # the newest stroke that touched it
        self._counts = np.zeros((0, side * side, FREE_LEVELS), np.uint16)
        self._highest = 0  # no count is above it
        self._rows = np.zeros((0, side * side), np.int32)
        self._spare_rows = np.zeros(1, np.int32)  # row 0 stands for none
        self._held = np.zeros(1, np.int32)
        self._sums = np.zeros((1, terms.shape[1]), np.float32)

    def count_cones(self, cones: np.ndarray, box: Box, sectors: int, sign: int) -> None:
        """Count cones (n, 7) in (``sign`` 1) or out (-1), as in ``stroke_cones``; ``box`` holds them all."""
        self._make_room(box, len(cones))
        if sign > 0:
            self._reserve_counts(len(cones))
        table = sectors_about(1 << box[4].bit_length(), sectors)
        change = self._counts.dtype.type(1) if sign > 0 else ~self._counts.dtype.type(0)
        self._kernels.stroke_cones(
            *(cones, table, sectors, self._corner, self._window, self._keys, self._pieces, self._stamps),
            *(self._spare, self._left, self._counts, self._side, change, self._stamp),
        )

    def add_arcs(self, arcs: np.ndarray, box: Box, cell_m: float, sign: int) -> None:
        """Add (``sign`` 1) or take off (-1) arcs (n, 5), as in ``stroke_arcs``; ``box`` holds them all."""
        self._make_room(box, len(arcs))
        self._reserve_rows(len(arcs) * (2 * box[4] + 1) ** 2)
        self._kernels.stroke_arcs(
            *(arcs, cell_m, self._corner, self._window, self._keys, self._pieces, self._stamps, self._spare),
            *(self._left, self._rows, self._spare_rows, self._held, self._sums, self._terms),
            *(self._side, sign, self._stamp),
        )

    def slots(self) -> dict[Key, int]:
        """The tiles that hold evidence, and their slots."""
        return self._by_key(self._pieces > 0)

    def touched(self) -> dict[Key, int | None]:
        """The tiles touched since this was last asked, and their slots; None for those that hold nothing any more."""
        told: dict[Key, int | None] = dict.fromkeys(self._gone)
        lately = self._stamps > self._asked
        told.update(dict.fromkeys(self._by_key(lately & (self._pieces == 0))))
        told.update(self._by_key(lately & (self._pieces > 0)))
        self._gone, self._asked = set(), self._stamp
        return told

    def stamp(self, slot: int) -> int:
        """The number of the newest stroke that touched the tile: what was made of it then is still right."""
        return int(self._stamps[slot])

    def counts(self, slot: int) -> np.ndarray:
        """How often each cell was called free, (cells, levels)."""
        return self._counts[slot]

    def sums(self, slot: int) -> tuple[np.ndarray, np.ndarray]:
        """The cells that arcs touch, (n,), and their sums, (n, width)."""
        touched = np.flatnonzero(self._rows[slot])
        return touched, self._sums[self._rows[slot, touched]]

    def _by_key(self, chosen: np.ndarray) -> dict[Key, int]:
        slots = np.flatnonzero(chosen)
        return {
            (column, row): slot for (column, row), slot in zip(self._keys[slots].tolist(), slots.tolist(), strict=True)
        }

    def _make_room(self, box: Box, strokes: int) -> None:
        """Let the window hold ``box`` and have spare slots for the tiles that so many strokes may touch."""
        self._stamp += 1
        side, covered = self._side, self._covered
        first_column, first_row, last_column, last_row = (cell // side for cell in box[:4])
        tiles = (last_column - first_column + 1) * (last_row - first_row + 1)
        needed = min(tiles, strokes * (2 * box[4] // side + 2) ** 2)
        inside = first_column >= covered[0] and first_row >= covered[1] and last_column <= covered[2]
        if inside and last_row <= covered[3] and self._left[0] >= needed:
            return
        self._collect()
        if self._left[0] < needed:
            self._add_slots(needed)
        margin = _MARGIN_TILES
        self._look_at(first_column - margin, first_row - margin, last_column + margin, last_row + margin)

    def _collect(self) -> None:
        """Make slots spare whose tiles hold nothing any more."""
        empty = self._pieces == 0
        self._gone.update(self._by_key(empty & (self._stamps > self._asked)))
        self._stamps[empty] = 0
        spare = np.flatnonzero(empty)[::-1]
        self._spare[: len(spare)], self._left[0] = spare, len(spare)

    def _add_slots(self, needed: int) -> None:
        before = len(self._pieces)
        used = int(np.flatnonzero(self._pieces).max(initial=-1)) + 1
        length = before + max(needed, before)
        self._counts, self._rows, self._pieces, self._keys, self._stamps = (
            _grown(array, used, length) for array in (self._counts, self._rows, self._pieces, self._keys, self._stamps)
        )
        self._spare = np.zeros(length, np.int32)
        self._collect()

    def _look_at(self, first_column: int, first_row: int, last_column: int, last_row: int) -> None:
        """Lay the window over these tiles."""
        self._covered = first_column, first_row, last_column, last_row
        self._corner = np.array([first_column, first_row])
        self._window = np.full((last_row - first_row + 1, last_column - first_column + 1), -1, np.int32)
        place = self._keys - self._corner
        size = last_column - first_column + 1, last_row - first_row + 1
        slots = np.flatnonzero((self._pieces > 0) & np.all((place >= 0) & (place < size), axis=1))
        self._window[place[slots, 1], place[slots, 0]] = slots

    def _reserve_counts(self, more: int) -> None:
        """Let counts of 16 bits become 32 bits wide before one could run over."""
        self._highest += more
        if self._highest > _MOST_COUNT and self._counts.dtype == np.uint16:
            self._highest = int(self._counts.max()) + more
            if self._highest > _MOST_COUNT:
                self._counts = self._counts.astype(np.uint32)

    def _reserve_rows(self, needed: int) -> None:
        left = int(self._left[1])
        if left < needed:
            before = len(self._held)
            length = before + max(needed, before)
            self._sums, self._held, self._spare_rows = (
                _grown(array, before, length) for array in (self._sums, self._held, self._spare_rows)
            )
            kept, new = self._spare_rows[:left].copy(), np.arange(before, length, dtype=np.int32)[::-1]
            self._spare_rows[: len(new)], self._spare_rows[len(new) : len(new) + left] = new, kept
            self._left[1] += len(new)


def _grown(array: np.ndarray, used: int, length: int) -> np.ndarray:
    """The first ``used`` entries, then zeros up to ``length``: memory that nobody writes to is not taken."""
    grown = np.zeros((length, *array.shape[1:]), array.dtype)
    grown[:used] = array[:used]
    return grown
