"""A map on the way to the contour."""

from dataclasses import dataclass

import numpy as np

from noctule_mapper.contour.corners import Link
from noctule_mapper.contour.reflectors import Reflector
from noctule_mapper.refinement.association import Scene


@dataclass(frozen=True)
class State:
    """Objects that may be the room's, which of their walls meet, which echoes they explain, and their worth in nats; in
    a scene where the poses are as they have fitted best with these objects.
    """

    objects: list[Reflector]
    links: list[Link]
    explained: np.ndarray
    worth: float
    scene: Scene
    of_poses: float  # how much of the worth is that of the poses
    # The worth if the poses were exactly as fitted, so that their errors excuse no range. Maps of fine sweeps grow by
    # `worth`; which of the grown ones is the best, and what of it is exchanged or dropped, goes by this.
    fitted_worth: float
