"""What one reading says of a place: the annular-sector model of Liu et al. 2019, Eq. 5-8, and the few beliefs that the
grid rounds it to.

As printed, Eq. 7 calls everything outside the arc surely free, behind the wall and beside the beam too. A reading knows
nothing of either, so here only the space before the arc and inside the beam is free.

Module ``grid.kernels`` compiles ``direction_trust``, ``off_arc``, ``free_level`` and ``arc_level`` as they stand here.
"""

import numpy as np

Values = np.ndarray | float

FREE_LEVELS = 8  # of trust in a direction; a belief that a place is free is rounded by a 16th of ``most_free``
ARC_STEPS = 32  # of trust in a direction, and as many of the distance from the arc


def direction_trust(angle_rad: Values, width_rad: Values) -> np.ndarray:
    """Eq. 5: lambda, 1 on the axis and 0 at half the width and beyond; ``angle_rad`` is off the axis, either way."""
    return np.maximum(0, 1 - 2 * np.abs(angle_rad) / width_rad)


def off_arc(distance_m: Values, range_m: Values, epsilon_m: Values) -> np.ndarray:
    """|d - R| / eps of Eq. 6-7: 0 on the arc's middle line, 1 at its edges."""
    return np.abs(distance_m - range_m) / epsilon_m


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
    off = off_arc(distance_m, range_m, epsilon_m)
    return _masses(np.where(off <= 1, direction_trust(angle_rad, width_rad), 0.0), off)


def _masses(trust: np.ndarray, off: np.ndarray) -> np.ndarray:
    """Eq. 6-8: occupied, free, unknown, (..., 3)."""
    return np.stack([trust * (1 - off), trust * off, 1 - trust], axis=-1)


def free_mass(
    distance_m: Values,
    angle_rad: Values,
    range_m: Values,
    epsilon_m: Values,
    width_rad: Values,
) -> np.ndarray:
    """Eq. 7 without its misprint: belief that a place is free because it lies inside the beam and before the arc; 0
    elsewhere.
    """
    return np.where(distance_m < range_m - epsilon_m, direction_trust(angle_rad, width_rad), 0.0)


def free_level(trust: Values) -> int:
    """The row of ``free_beliefs`` for a place before the arc; a single number."""
    return min(int(trust * FREE_LEVELS), FREE_LEVELS - 1)


def free_beliefs(most_free: float) -> np.ndarray:
    """What the grid takes a place before the arc for, (FREE_LEVELS, 3): level k stands for trust in [k, k + 1) /
    FREE_LEVELS, and a single reading is believed ``most_free`` at most.
    """
    free = most_free * (np.arange(FREE_LEVELS) + 0.5) / FREE_LEVELS
    return np.stack([0 * free, free, 1 - free], axis=-1)


def arc_level(trust: Values, off: Values) -> int:
    """The row of ``arc_beliefs`` for a place on the arc; single numbers."""
    return min(int(trust * ARC_STEPS), ARC_STEPS - 1) * ARC_STEPS + min(int(off * ARC_STEPS), ARC_STEPS - 1)


def arc_beliefs(most_occupied: float) -> np.ndarray:
    """What the grid takes a place on an arc for (Eq. 6-8), (ARC_STEPS^2, 3): row by row of trust, column by column of
    ``off_arc``; a single reading is believed ``most_occupied`` at most.
    """
    middle = (np.arange(ARC_STEPS) + 0.5) / ARC_STEPS
    trust, off = (a.ravel() for a in np.meshgrid(most_occupied * middle, middle, indexing="ij"))
    return _masses(trust, off)
