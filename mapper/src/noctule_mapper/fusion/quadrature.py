"""Nodes and weights of the fusion integral: 1/S as a short sum of exponentials, for every S from 1e-8 to 64.

``design`` finds them; ``python -m noctule_mapper.fusion.quadrature`` writes its result into the table that ships
beside this module, so that nobody pays for the search at start-up.
"""

import csv
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

MOST_SUM = 64.0  # as many certain sources; of more, the sum falls short alike for all sets: fusion divides it out
LEAST_SUM = 1e-8  # of the masses in one product; what is below it weighs less than the error
_TABLE = "quadrature.csv"


@cache
def nodes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes t and weights w, (count,) each, with sum_q w_q exp(-S t_q) = 1/S; ValueError for a count that is not in the
    table.
    """
    with resources.files("noctule_mapper.fusion").joinpath(_TABLE).open(encoding="ascii") as table:
        rows = np.array(
            [(float(row["t"]), float(row["w"])) for row in csv.DictReader(table) if int(row["count"]) == count]
        )
    if not len(rows):
        raise ValueError(f"no quadrature of {count} nodes: add the count to COUNTS and run this module as a command")
    return rows[:, 0], rows[:, 1]


COUNTS = (12, 16, 32)


def worst_case(sums: np.ndarray) -> np.ndarray:
    """How much of all products can have such a sum, in the worst of beliefs of MOST_SUM sources."""
    return np.minimum(1, MOST_SUM * sums)


def design(count: int, rounds: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights, (count,) each, that nearly minimise the largest error of a fused belief over LEAST_SUM <= S <=
    MOST_SUM.

    A product's share errs by |S sum_q w_q exp(-S t_q) - 1|, and that counts by ``worst_case``. Start: the trapezoid in
    x of t = exp(x - exp(-x)); then least squares in log t and log w, with the worst S weighed up from round to round.
    """
    from scipy.optimize import least_squares  # takes a while to load, and the table is there already

    sums = np.geomspace(LEAST_SUM, MOST_SUM, 480)
    worth = worst_case(sums) * sums
    x = np.linspace(-1.5, -0.75 * np.log(LEAST_SUM), count)
    start = np.exp(x - np.exp(-x))
    parameters = np.log(np.concatenate([start, (x[1] - x[0]) * start * (1 + np.exp(-x))]))
    emphasis = np.ones_like(sums)
    best, best_error = parameters, np.inf

    def terms(parameters: np.ndarray) -> np.ndarray:
        t, w = np.exp(parameters).reshape(2, count)
        return np.exp(-np.outer(sums, t)) * w

    def residual(parameters: np.ndarray) -> np.ndarray:
        return emphasis * (worth * terms(parameters).sum(axis=1) - worth / sums)

    def jacobian(parameters: np.ndarray) -> np.ndarray:
        slope = (emphasis * worth)[:, None] * terms(parameters)
        return np.hstack([-slope * np.outer(sums, np.exp(parameters[:count])), slope])

    for _ in range(rounds):
        jac: Any = jacobian  # SciPy's types know only its own methods by name
        parameters = least_squares(residual, parameters, jac, xtol=1e-15, ftol=1e-15, gtol=1e-15, max_nfev=200).x
        error = np.abs(residual(parameters) / emphasis)
        if error.max() < best_error:
            best, best_error = parameters, error.max()
        emphasis = emphasis * np.sqrt(error / error.max() + 0.05)
        emphasis = emphasis / emphasis.mean()
    t, w = np.exp(best).reshape(2, count)
    order = np.argsort(t)
    return t[order], w[order]


def write_table(path: Path) -> None:
    """Design every count of COUNTS and write the table: count, t, w."""
    with path.open("w", encoding="ascii", newline="") as table:
        writer = csv.writer(table, lineterminator="\n")
        writer.writerow(("count", "t", "w"))
        for count in COUNTS:
            writer.writerows((count, repr(float(t)), repr(float(w))) for t, w in zip(*design(count), strict=True))


if __name__ == "__main__":
    write_table(Path(__file__).with_name(_TABLE))
