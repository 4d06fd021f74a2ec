"""The assignment problem, by shortest augmenting paths (Crouse 2016, On implementing 2D rectangular assignment
algorithms). SciPy solves it too, but loading what it needs for that takes longer than a fit.
"""

import numpy as np


def assignment(cost: np.ndarray) -> np.ndarray:
    """The column of each row, int (rows,), no two the same, at the least total ``cost``, float (rows, columns), which
    may hold infinities. Every row must have a finite cost in a column of its own.
    """
    rows, columns = cost.shape
    least = cost.argmin(axis=1)
    row_price, column_price = cost[np.arange(rows), least], np.zeros(columns)
    column_of, row_of = np.full(rows, -1), np.full(columns, -1)
    first = np.unique(least, return_index=True)[1]  # rows that can have the column that they like best
    column_of[first], row_of[least[first]] = least[first], first
    for row in np.nonzero(column_of < 0)[0]:
        _augment(int(row), cost, column_of, row_of, row_price, column_price)
    return column_of


def _augment(
    start: int,
    cost: np.ndarray,
    column_of: np.ndarray,
    row_of: np.ndarray,
    row_price: np.ndarray,
    column_price: np.ndarray,
) -> None:
    """Give the row ``start`` a column along the cheapest path of exchanges. The other arrays are changed in place."""
    path_cost, row_before = np.full(len(row_of), np.inf), np.full(len(row_of), -1)
    is_reached = np.zeros(len(row_of), bool)
    row, so_far = start, 0.0
    while row >= 0:
        through = so_far + cost[row] - row_price[row] - column_price
        cheaper = ~is_reached & (through < path_cost)
        path_cost[cheaper], row_before[cheaper] = through[cheaper], row
        end = int(np.where(is_reached, np.inf, path_cost).argmin())
        is_reached[end], so_far = True, float(path_cost[end])
        row = int(row_of[end])
    saved = so_far - path_cost[is_reached]
    owners = row_of[is_reached]
    row_price[owners[owners >= 0]] += saved[owners >= 0]
    row_price[start] += so_far
    column_price[is_reached] -= saved
    while row != start:
        row = int(row_before[end])
        row_of[end] = row
        column_of[row], end = end, int(column_of[row])
