"""Connected components of an undirected graph. SciPy has them too, but loading its graphs takes longer than a fit."""

from collections.abc import Sequence

import numpy as np


def connected_components(
    first: Sequence[int] | np.ndarray, second: Sequence[int] | np.ndarray, count: int
) -> np.ndarray:
    """The component of each of ``count`` nodes, int (count,), numbered in the order of their lowest nodes. Node
    ``first[i]`` is linked with ``second[i]``.
    """
    first, second = np.asarray(first, dtype=int), np.asarray(second, dtype=int)
    lowest = np.arange(count)  # each node's, as far as it is known
    while True:
        before = lowest.copy()
        reached = np.minimum(lowest[first], lowest[second])
        for end in (first, second):
            np.minimum.at(lowest, lowest[end], reached)  # tell the nodes that stand for the ends
            np.minimum.at(lowest, end, reached)
        while not np.array_equal(lowest, further := lowest[lowest]):
            lowest = further
        if np.array_equal(lowest, before):
            return np.unique(lowest, return_inverse=True)[1].reshape(count)
