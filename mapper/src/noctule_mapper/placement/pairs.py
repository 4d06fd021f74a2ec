"""Poses of units in the frames of one another, and frames within frames."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from noctule_mapper.placement.pose_search import pair_starts
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView


@dataclass(frozen=True, eq=False)
class Pairs:
    """Poses of one unit in the frame of another, kept by the two units' names."""

    starts: dict[tuple[str, str], np.ndarray] = field(default_factory=dict)

    def of(self, view: UnitView, one: UnitView) -> np.ndarray:
        key = view.unit, one.unit
        if key not in self.starts:
            self.starts[key] = pair_starts(view, one)
        return self.starts[key]

    def at(self, view: UnitView, placed: Sequence[PlacedUnit]) -> np.ndarray:
        """Poses (k, 3) of the unit in the frame of those that are placed."""
        return np.concatenate([moved(one.pose, self.of(view, one.view)) for one in placed])


def moved(frame: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """Poses (k, 3) that are stated in the frame of a pose (3,), as poses outside."""
    cosine, sine = np.cos(frame[2]), np.sin(frame[2])
    x_m, y_m, heading_rad = poses.T
    return np.stack(
        [frame[0] + cosine * x_m - sine * y_m, frame[1] + sine * x_m + cosine * y_m, frame[2] + heading_rad], axis=1
    )


def inverse(pose: np.ndarray) -> np.ndarray:
    """The pose of the outside in the frame of ``pose`` (3,)."""
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    return np.array([-cosine * pose[0] - sine * pose[1], sine * pose[0] - cosine * pose[1], -pose[2]])
