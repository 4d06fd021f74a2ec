"""Pairs of readings that may be of one reflector, by where they were heard and how far."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.readings import arrays
from noctule_mapper.readings.echoes import Echoes


@dataclass(frozen=True)
class Offsets:
    """From the other's place to the reading's, and how much longer the reading's range is; arrays of one shape."""

    dx_m: np.ndarray
    dy_m: np.ndarray
    baseline_m: np.ndarray
    longer_m: np.ndarray

    take = arrays.take


def offsets(echoes: Echoes, i: np.ndarray, others: Echoes, j: np.ndarray) -> Offsets:
    """Between the echoes numbered ``i`` and the others numbered ``j``, in the shape that the two have together: each
    with each for (n, 1) and (m,).
    """
    dx_m, dy_m = echoes.x_m[i] - others.x_m[j], echoes.y_m[i] - others.y_m[j]
    return Offsets(dx_m, dy_m, np.hypot(dx_m, dy_m), echoes.range_m[i] - others.range_m[j])


def may_share(
    baseline_m: np.ndarray, longer_m: np.ndarray, shortest_m: float, longest_m: float | np.ndarray
) -> np.ndarray:
    """Whether two readings may touch one circle: from ``shortest_m`` to ``longest_m`` apart, and their ranges no more
    unlike than their places, or no circle touches both arcs.
    """
    return (baseline_m >= shortest_m) & (baseline_m <= longest_m) & (np.abs(longer_m) <= baseline_m)


def near_pairs(
    echoes: Echoes, others: Echoes, shortest_m: float, longest_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pairs that may share a reflector: numbers of the echo and of the other, and their baseline, (p,) each.

    Of many echoes a tree finds them without a matrix of all with all.
    """
    from scipy.spatial import KDTree  # takes a while to load, and only the tangent circles need it

    places, other_places = (KDTree(np.stack([one.x_m, one.y_m], axis=1)) for one in (echoes, others))
    near = places.sparse_distance_matrix(other_places, longest_m, output_type="coo_matrix")
    i, j, baseline_m = near.row, near.col, near.data
    kept = may_share(baseline_m, echoes.range_m[i] - others.range_m[j], shortest_m, longest_m)
    return i[kept], j[kept], baseline_m[kept]
