"""Which cylinders can be told from a wall: the greatest radius against the distance L, the step l and the deviation d
(Liu et al. 2019, Section V.C, Fig. 15).

Three positions l apart on a line, the cylinder of radius R before the middle one: R2 = L - d and, as the outer two are
equal, R2d = R1 = R3 = L. A wall has d = 0; a cylinder is recognised while d exceeds the threshold, Th = sigma.
"""

import numpy as np

Values = np.ndarray | float


def greatest_radius_m(distance_m: Values, step_m: Values, deviation_m: Values) -> Values:
    """Eq. 24-25 corrected: R = l^2 / (2 d) - L + d / 2, from (R + L)^2 = l^2 + (R + L - d)^2.

    With l = 20 cm and d = 0.32 cm that is 625 cm - L. A result below zero: no cylinder is recognised from there.
    """
    return step_m**2 / (2 * deviation_m) - distance_m + deviation_m / 2


def greatest_radius_as_printed_m(distance_m: Values, step_m: Values, deviation_m: Values) -> Values:
    """Eq. 25 as the paper prints it, R = l^2 / (4 d) - L (the term d is left out there as small).

    Eq. 24 prints R2 - d though R2 already is L - d, so it takes d off twice. With l = 20 cm and d = 0.32 cm: 312.5 cm
    - L; with d = 3 sigma: 104.16 cm - L.
    """
    return step_m**2 / (4 * deviation_m) - distance_m


def deviation_m(radius_m: Values, distance_m: Values, step_m: Values) -> Values:
    """d = R2d - R2 of a cylinder whose nearest point is ``distance_m`` before the middle position, R2 = L - d."""
    return np.hypot(step_m, radius_m + distance_m) - radius_m - distance_m
