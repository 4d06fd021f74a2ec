"""A map on the way to the contour."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.reflectors import Reflector


@dataclass(frozen=True)
class State:
    """Objects that may be the room's, which of their walls meet, which echoes they explain, and their worth in nats."""

    objects: list[Reflector]
    links: list[Link]
    explained: np.ndarray
    worth: float
