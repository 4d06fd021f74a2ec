"""Three places on a line: what their ranges to a wall have in common (Liu et al. 2019, Eq. 1)."""

import numpy as np

Values = np.ndarray | float


def reference_range_m(first_m: Values, third_m: Values, d12_m: Values, d13_m: Values) -> Values:
    """Eq. 1, its bracket corrected, R2d = R1 + (R3 - R1) d12 / d13: the range that a wall would give position 2.

    It holds for position 2 on the line between positions 1 and 3. The paper prints R1 + (R3 - R1 d12 / d13).
    """
    return first_m + (third_m - first_m) * d12_m / d13_m  # (1)


def deviation_sigma_m(sigma_m: tuple[Values, Values, Values], d12_m: Values, d13_m: Values) -> np.ndarray:
    """Sigma of d = R2d - R2 on a wall from the sigmas of R1, R2 and R3: sqrt(3 / 2) of a range's at equal spacing."""
    first_m, second_m, third_m = sigma_m
    share = d12_m / d13_m
    return np.sqrt(((1 - share) * first_m) ** 2 + second_m**2 + (share * third_m) ** 2)


def deviation_scale(d12_m: Values, d13_m: Values) -> np.ndarray:
    """Sigma of d in sigmas of a range, where the three have the same."""
    return deviation_sigma_m((1.0, 1.0, 1.0), d12_m, d13_m)


def off_line_m(dx1_m: Values, dy1_m: Values, dx3_m: Values, dy3_m: Values) -> np.ndarray:
    """How far position 2 lies off the line through positions 1 and 3, told by the ways from it to these."""
    span_m = np.hypot(dx1_m - dx3_m, dy1_m - dy3_m)
    return np.abs(dx1_m * dy3_m - dy1_m * dx3_m) / np.maximum(span_m, _ONE_PLACE_M)


_ONE_PLACE_M = 1e-9  # positions 1 and 3 no farther apart have no line through them
