"""The paper's own test of wall against cylinder: R2d over three adjacent positions on a line (Liu et al. 2019, Section
II.B).

A wall gives collinear positions a range that is linear in the way along them; between two that touch a cylinder the
third is nearer than that.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.voting import Kind
from noctule_mapper.readings import arrays
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.collinear import deviation_sigma_m, off_line_m, reference_range_m
from noctule_mapper.readings.echoes import Echoes
from noctule_mapper.readings.pairs import near_pairs


def contour_type(deviation_m: np.ndarray, threshold_m: np.ndarray | float) -> np.ndarray:
    """Eq. 2: a wall ("plan") where |R2d - R2| < Th, else a cylinder; Kind.NONE where the deviation is NaN."""
    kind = np.where(np.abs(deviation_m) < threshold_m, Kind.WALL, Kind.CYLINDER)
    return np.where(np.isnan(deviation_m), Kind.NONE, kind)


@dataclass(frozen=True)
class R2dTest:
    """Arrays (n,): each reading as position 2; NaN, -1 and kind NONE where it has no adjacent collinear positions."""

    first: np.ndarray  # numbers of the other echoes at positions 1 and 3
    third: np.ndarray
    d12_m: np.ndarray
    d13_m: np.ndarray
    deviation_m: np.ndarray  # d = R2d - R2
    threshold_m: np.ndarray  # Th
    kind: np.ndarray

    take = arrays.take


def r2d_test(echoes: Echoes, others: Echoes, config: ContactConfig) -> R2dTest:
    """Eq. 1-2 for each of ``echoes`` (n,) between the two nearest of ``others`` (m,) that point its way, one on either
    side in line with it.

    Th is ``r2d_threshold_m``, or by default ``r2d_sigmas`` of d's own sigma (Section V.B: Th = sigma).
    """
    first, third = _adjacent(echoes, others, config)
    tested = first >= 0
    one, three = others.take(first[tested]), others.take(third[tested])
    two = echoes.take(tested)
    d12_m = np.hypot(one.x_m - two.x_m, one.y_m - two.y_m)
    d13_m = d12_m + np.hypot(three.x_m - two.x_m, three.y_m - two.y_m)
    sigma_m = deviation_sigma_m((one.sigma_m, two.sigma_m, three.sigma_m), d12_m, d13_m)
    threshold_m = config.r2d_sigmas * sigma_m
    if config.r2d_threshold_m is not None:
        threshold_m = np.full(len(two), config.r2d_threshold_m)
    deviation_m = reference_range_m(one.range_m, three.range_m, d12_m, d13_m) - two.range_m
    deviation_m, threshold_m = _spread(deviation_m, tested), _spread(threshold_m, tested)
    kind = contour_type(deviation_m, threshold_m)
    return R2dTest(first, third, _spread(d12_m, tested), _spread(d13_m, tested), deviation_m, threshold_m, kind)


def _spread(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """``values`` at the places of the mask ``where``, NaN elsewhere."""
    spread = np.full(len(where), np.nan)
    spread[where] = values
    return spread


def _adjacent(echoes: Echoes, others: Echoes, config: ContactConfig) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the others at positions 1 and 3 of each echo, (n,) each, -1 where there are none."""
    first, third = np.full(len(echoes), -1), np.full(len(echoes), -1)
    if not len(echoes):
        return first, third
    i, j, away = near_pairs(echoes, others, config.shortest_baseline_m, config.longest_baseline_m)
    alike = np.abs(wrapped(others.axis_rad[j] - echoes.axis_rad[i])) < echoes.half_beam_rad[i]
    order = np.lexsort((j[alike], away[alike], i[alike]))
    i, j, away = i[alike][order], j[alike][order], away[alike][order]
    starts = np.searchsorted(i, np.arange(len(echoes) + 1))
    for number, (start, end) in enumerate(pairwise(starts)):
        dx = others.x_m[j[start:end]] - echoes.x_m[number]
        dy = others.y_m[j[start:end]] - echoes.y_m[number]
        pair = _nearest_on_either_side(dx, dy, away[start:end], config.collinear_m)
        if pair is not None:
            first[number], third[number] = j[start + pair[0]], j[start + pair[1]]
    return first, third


def _nearest_on_either_side(dx: np.ndarray, dy: np.ndarray, away: np.ndarray, off_m: float) -> tuple[int, int] | None:
    """Of neighbours (m,), nearest first, the two whose line passes within ``off_m`` between them and that are nearest
    together.
    """
    on_line = off_line_m(dx[:, None], dy[:, None], dx, dy) <= off_m
    opposite = (np.outer(dx, dx) + np.outer(dy, dy) < 0) & on_line
    length = np.where(opposite, away[:, None] + away, np.inf)
    if not len(away) or not np.isfinite(length.min()):
        return None
    one, other = np.unravel_index(length.argmin(), length.shape)
    return int(one), int(other)
