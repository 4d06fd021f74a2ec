"""What one reading says of a place: the annular-sector model of Liu et al. 2019, Eq. 5-8, with the misprint of Eq. 7
put right.

As printed, Eq. 7 calls everything outside the arc surely free, behind the wall and beside the beam too. A reading knows
nothing of either.
"""

import numpy as np

Values = np.ndarray | float


def direction_trust(angle_rad: Values, width_rad: Values) -> np.ndarray:
    """Eq. 5: lambda, 1 on the axis and 0 at half the width and beyond; ``angle_rad`` is off the axis, either way."""
    return np.maximum(0, 1 - 2 * np.abs(angle_rad) / width_rad)


def arc_masses(
    distance_m: Values,
    angle_rad: Values,
    range_m: Values,
    epsilon_m: Values,
    width_rad: Values,
) -> np.ndarray:
    """Eq. 6-8 on the arc |d - R| <= eps: beliefs (..., 3) that a place is occupied, free, unknown; off the arc all is
    unknown.

    ``distance_m`` and ``angle_rad`` place it against sensor and axis. With the beam for axis and width this is a single
    reading; about a contact, with width 6 eps / R, it is the contact region of Section III.C.
    """
    off = np.abs(distance_m - range_m) / epsilon_m
    trust = np.where(off <= 1, direction_trust(angle_rad, width_rad), 0.0)
    return np.stack([trust * (1 - off), trust * off, 1 - trust], axis=-1)


def free_mass(
    distance_m: Values,
    angle_rad: Values,
    range_m: Values,
    epsilon_m: Values,
    width_rad: Values,
) -> np.ndarray:
    """Eq. 7 put right: belief that a place is free, for it lies inside the beam and before the arc; 0 elsewhere."""
    return np.where(distance_m < range_m - epsilon_m, direction_trust(angle_rad, width_rad), 0.0)
