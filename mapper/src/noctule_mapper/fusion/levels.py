"""The few beliefs that a grid can hold: what a reading says of a cell, rounded, so that the evidence of each is known
beforehand.
"""

import numpy as np

FREE_LEVELS = 8  # of trust in a direction; a belief that a place is free is rounded by a 16th of ``most_free``
ARC_STEPS = 32  # of trust in a direction, and as many of the distance from the arc


def free_beliefs(most_free: float) -> np.ndarray:
    """Beliefs in free space, (FREE_LEVELS, 3), by trust in the direction: level k stands for trust in [k, k + 1) /
    FREE_LEVELS.
    """
    free = most_free * (np.arange(FREE_LEVELS) + 0.5) / FREE_LEVELS
    return np.stack([0 * free, free, 1 - free], axis=-1)


def arc_beliefs(most_occupied: float) -> np.ndarray:
    """Beliefs on an arc (Eq. 6-8), (ARC_STEPS^2, 3): row by row of trust in the direction, column by column of the
    distance from the arc in eps.
    """
    middle = (np.arange(ARC_STEPS) + 0.5) / ARC_STEPS
    trust, off = (a.ravel() for a in np.meshgrid(most_occupied * middle, middle, indexing="ij"))
    return np.stack([trust * (1 - off), trust * off, 1 - trust], axis=-1)
