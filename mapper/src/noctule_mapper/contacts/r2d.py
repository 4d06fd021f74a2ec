"""The paper's own test of wall against cylinder: R2d over three adjacent positions on a line (Liu et al. 2019, Section
II.B).

A wall gives collinear positions a range that is linear in the way along them; between two that touch a cylinder the
third is nearer than that.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noctule_mapper.config import ContactConfig
from noctule_mapper.contacts.voting import Kind, neighbours
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.echoes import Echoes

Values = np.ndarray | float


def reference_range_m(first_m: Values, third_m: Values, d12_m: Values, d13_m: Values) -> Values:
    """Eq. 1 with its bracket put right, R2d = R1 + (R3 - R1) d12 / d13: the range that a wall would give position 2.

    It holds for position 2 on the line between positions 1 and 3. The paper prints R1 + (R3 - R1 d12 / d13).
    """
    return first_m + (third_m - first_m) * d12_m / d13_m


def deviation_sigma_m(sigma_m: tuple[Values, Values, Values], d12_m: Values, d13_m: Values) -> np.ndarray:
    """Sigma of d = R2d - R2 on a wall from the sigmas of R1, R2 and R3: sqrt(3 / 2) of a range's at equal spacing."""
    first_m, second_m, third_m = sigma_m
    share = d12_m / d13_m
    return np.sqrt(((1 - share) * first_m) ** 2 + second_m**2 + (share * third_m) ** 2)


def contour_type(deviation_m: np.ndarray, threshold_m: Values) -> np.ndarray:
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

    def take(self, index: np.ndarray | slice) -> "R2dTest":
        """The tests at ``index`` (numbers, a mask or a slice)."""
        return R2dTest(**{name: getattr(self, name)[index] for name in self.__dataclass_fields__})


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


def _spread(values: Values, where: np.ndarray) -> np.ndarray:
    """``values`` at the places of the mask ``where``, NaN elsewhere."""
    spread = np.full(len(where), np.nan)
    spread[where] = values
    return spread


def _adjacent(echoes: Echoes, others: Echoes, config: ContactConfig) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the others at positions 1 and 3 of each echo, (n,) each, -1 where there are none."""
    first, third = np.full(len(echoes), -1), np.full(len(echoes), -1)
    if not len(echoes):
        return first, third
    i, j, away = neighbours(echoes, others, config)
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
    span = np.hypot(dx[:, None] - dx, dy[:, None] - dy)
    off = np.abs(np.outer(dx, dy) - np.outer(dy, dx)) / np.maximum(span, 1e-9)
    opposite = (np.outer(dx, dx) + np.outer(dy, dy) < 0) & (off <= off_m)
    length = np.where(opposite, away[:, None] + away, np.inf)
    if not len(away) or not np.isfinite(length.min()):
        return None
    one, other = np.unravel_index(length.argmin(), length.shape)
    return int(one), int(other)
