"""PCR5 in a cell of the grid: it has no sums, so a cell keeps how often it was given which belief, and folds them."""

import numpy as np

from noctule_mapper.fusion.rules import fuse
from noctule_mapper.fusion.streams import Stream


def folded_pcr5(beliefs: np.ndarray) -> Stream:
    """PCR5 over readings that say one of ``beliefs`` (levels, 3): two at a time, what is free first, then the others
    by their occupied mass, so that the order in which readings come does not matter.

    Of two readings this is PCR5. Of more it is not PCR5 of all at once, which has 3^s terms.
    """
    return Stream(lambda masses: np.eye(len(masses)), lambda counts: _fold(beliefs, counts))


def _fold(beliefs: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Counts (cells, levels) to beliefs (cells, 3)."""
    only_free = beliefs[:, 0] == 0
    unknown = np.exp(counts[:, only_free] @ np.log(beliefs[only_free, 2]))  # these do not conflict: m(U) is a product
    fused = np.stack([0 * unknown, 1 - unknown, unknown], axis=-1)
    rising = np.flatnonzero(~only_free)[np.argsort(beliefs[~only_free, 0], kind="stable")]
    times = np.rint(counts[:, rising]).astype(int)
    cell, place = np.nonzero(times)
    repeats = times[cell, place]
    cell, level = np.repeat(cell, repeats), np.repeat(rising[place], repeats)
    turn = np.arange(len(cell)) - np.searchsorted(cell, cell)
    for now in range(turn.max(initial=-1) + 1):
        mine = cell[turn == now]
        fused[mine] = fuse(np.stack([fused[mine], beliefs[level[turn == now]]]), "pcr5")
    return fused
