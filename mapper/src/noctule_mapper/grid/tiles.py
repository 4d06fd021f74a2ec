"""Where the grid's evidence is kept: tiles that exist while there is evidence in them, in arrays that all tiles share.

Nearly all that is said of a cell is that it is free, at one of a few levels: of that a cell keeps counts. Only a cell
that an arc touches has a row of sums. Both are exact enough to take evidence out again, and a cell takes few bytes.
"""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.fusion.levels import ARC_STEPS, FREE_LEVELS
from noctule_mapper.grid.polar_cells import Disc

Key = tuple[int, int]


@dataclass(frozen=True)
class _Window:
    """The tiles about a stroke: ``corner``, the lower left cell; (rows, columns): slots, -1 for none, and the pieces of
    evidence that came or went.
    """

    corner: np.ndarray
    slots: np.ndarray
    pieces: np.ndarray


class Tiles:
    """Square tiles of ``side`` cells, a power of two; ``terms`` (levels, width) are those of the arcs' beliefs."""

    def __init__(self, side: int, terms: np.ndarray) -> None:
        from noctule_mapper.grid import kernels  # loads Numba, which only a grid that is made should cost

        self._kernels = kernels
        self.slots: dict[Key, int] = {}
        self._side, self._bits = side, side.bit_length() - 1
        self._terms = terms
        self._spare = np.zeros(0, np.int32)
        self._pieces = np.zeros(0, np.int64)
        self._counts = np.zeros((0, FREE_LEVELS, side * side), np.uint16)
        self._highest = 0  # no count is above it
        self._rows = np.zeros((0, side * side), np.int32)
        self._spare_rows, self._left_rows = np.zeros(1, np.int32), 0  # row 0 stands for none
        self._held = np.zeros(1, np.int32)
        self._sums = np.zeros((1, terms.shape[1]), np.float32)

    def count_cones(self, apex: np.ndarray, beam: np.ndarray, disc: Disc, sign: int) -> list[Key]:
        """Count cones in (``sign`` 1) or out (-1), arrays as in ``stroke_cones``; the tiles touched."""
        reach = int(beam[:, 3].max()) + 1
        window = self._window(apex, reach)
        self._reserve_tiles(min(window.slots.size, len(apex) * (2 * reach // self._side + 2) ** 2))
        if sign > 0:
            self._reserve_counts(len(apex))
        change = self._counts.dtype.type(1) if sign > 0 else ~self._counts.dtype.type(0)
        places = apex - window.corner
        table = disc.first, disc.step, disc.distance
        left = self._kernels.stroke_cones(
            places, beam, *table, window.slots, window.pieces, self._spare, self._counts, self._bits, change
        )
        return self._settle(window, left, sign)

    def add_arcs(self, arcs: np.ndarray, cell_m: float, sign: int) -> list[Key]:
        """Add (``sign`` 1) or take off (-1) arcs (n, 5), as in ``stroke_arcs``; the tiles touched."""
        middle = arcs[:, :2] + arcs[:, 2:3] * np.stack([np.cos(arcs[:, 3]), np.sin(arcs[:, 3])], axis=1)
        reach = arc_reach_cells(arcs, cell_m)
        window = self._window(np.floor(middle / cell_m).astype(int), reach)
        self._reserve_tiles(min(window.slots.size, len(arcs) * (2 * reach // self._side + 2) ** 2))
        self._reserve_rows(len(arcs) * (2 * reach + 1) ** 2)
        left, self._left_rows = self._kernels.stroke_arcs(
            *(arcs, window.corner, cell_m, ARC_STEPS, window.slots, window.pieces, self._spare, self._rows),
            *(self._spare_rows, self._left_rows, self._held, self._sums, self._terms, self._bits, sign),
        )
        return self._settle(window, left, sign)

    def counts(self, key: Key) -> np.ndarray:
        """How often each cell was called free, (levels, cells)."""
        return self._counts[self.slots[key]]

    def sums(self, key: Key) -> tuple[np.ndarray, np.ndarray]:
        """The cells that arcs touch, (n,), and their sums, (n, width)."""
        rows = self._rows[self.slots[key]]
        touched = np.flatnonzero(rows)
        return touched, self._sums[rows[touched]]

    def _window(self, cells: np.ndarray, reach: int) -> _Window:
        """The tiles that hold what is within ``reach`` columns and rows of ``cells`` (n, 2)."""
        first = ((cells.min(axis=0) - reach) // self._side).tolist()
        last = ((cells.max(axis=0) + reach) // self._side).tolist()
        slots = [
            [self.slots.get((column, row), -1) for column in range(first[0], last[0] + 1)]
            for row in range(first[1], last[1] + 1)
        ]
        slots = np.array(slots, np.int32)
        return _Window(np.array(first) * self._side, slots, np.zeros(slots.shape, np.int64))

    def _settle(self, window: _Window, left: int, sign: int) -> list[Key]:
        """Enter new tiles, let those go that hold nothing any more; the tiles touched."""
        self._spare = self._spare[:left]
        touched = []
        for row, column in np.argwhere(window.pieces).tolist():
            slot = int(window.slots[row, column])
            key = (int(window.corner[0]) // self._side + column, int(window.corner[1]) // self._side + row)
            touched.append(key)
            self.slots[key] = slot
            self._pieces[slot] += sign * window.pieces[row, column]
            if not self._pieces[slot]:
                del self.slots[key]
                self._spare = np.append(self._spare, np.int32(slot))
        return touched

    def _reserve_tiles(self, needed: int) -> None:
        if len(self._spare) < needed:
            before, used = len(self._pieces), max(self.slots.values(), default=-1) + 1
            self._counts, self._rows, self._pieces = (
                _grown(array, used, before + max(needed, before)) for array in (self._counts, self._rows, self._pieces)
            )
            self._spare = np.concatenate([np.arange(before, len(self._pieces), dtype=np.int32)[::-1], self._spare])

    def _reserve_counts(self, more: int) -> None:
        """Let counts of 16 bits become 32 bits wide before one could run over."""
        self._highest += more
        if self._highest > np.iinfo(np.uint16).max and self._counts.dtype == np.uint16:
            self._highest = int(self._counts.max()) + more
            if self._highest > np.iinfo(np.uint16).max:
                self._counts = self._counts.astype(np.uint32)

    def _reserve_rows(self, needed: int) -> None:
        if self._left_rows < needed:
            before = len(self._held)
            self._sums, self._held, self._spare_rows = (
                _grown(array, before, before + max(needed, before))
                for array in (self._sums, self._held, self._spare_rows)
            )
            new = np.arange(before, len(self._held), dtype=np.int32)[::-1]
            left = self._spare_rows[: self._left_rows].copy()
            self._spare_rows[: len(new)], self._spare_rows[len(new) : len(new) + len(left)] = new, left
            self._left_rows += len(new)


def arc_reach_cells(arcs: np.ndarray, cell_m: float) -> int:
    """How far from its contact any of ``arcs`` (n, 5), n of at least 1, may be stroked; the root of 19 is under 4.4."""
    return int(4.4 * arcs[:, 4].max() / cell_m) + 3


def _grown(array: np.ndarray, used: int, length: int) -> np.ndarray:
    """The first ``used`` entries, then zeros up to ``length``: memory that nobody writes to is not taken."""
    grown = np.zeros((length, *array.shape[1:]), array.dtype)
    grown[:used] = array[:used]
    return grown
