"""Hypotheses of where all units stand together, and which of them are alike."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noctule_mapper.placement.landmarks import Landmarks, landmarks_of
from noctule_mapper.placement.pose_search import SAME_M, SAME_RAD
from noctule_mapper.placement.reflector_models import Members, PlacedUnit
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """Where units stand, those that nobody else hears left out, and what all this is worth in nats. ``waiting`` have
    not been looked for.
    """

    placed: tuple[PlacedUnit, ...]
    groups: tuple[Members, ...]
    waiting: tuple[UnitView, ...]
    worth_nats: float
    dropped_nats: float = 0.0  # so far below the best it was not followed any more, 0 if it never was

    def pose_of(self, unit: str) -> np.ndarray | None:
        return next((one.pose for one in self.placed if one.view.unit == unit), None)

    @cached_property
    def marks(self) -> Landmarks:
        return landmarks_of(self.placed, self.groups)

    def has_looked_for(self, unit: str) -> bool:
        return all(view.unit != unit for view in self.waiting)


def distinct(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Those that differ in some unit's pose, the worthiest first."""
    chosen: list[Hypothesis] = []
    for one in sorted(hypotheses, key=lambda one: -one.worth_nats):
        if not any(_are_same(one, other) for other in chosen):
            chosen.append(one)
    return chosen


def _are_same(one: Hypothesis, other: Hypothesis) -> bool:
    units = {each.view.unit for each in one.placed}
    return units == {each.view.unit for each in other.placed} and all(
        is_same(one.pose_of(unit), other.pose_of(unit)) for unit in units
    )


def is_same(first: np.ndarray | None, second: np.ndarray | None) -> bool:
    if first is None or second is None:
        return first is second
    off_m, off_rad = np.hypot(*(first - second)[:2]), abs(wrapped(first[2] - second[2]))
    return bool(off_m < SAME_M and off_rad < SAME_RAD)


def is_part(one: Hypothesis, other: Hypothesis) -> bool:
    """Whether all units of ``one`` stand alike in ``other``."""
    return all(is_same(each.pose, other.pose_of(each.view.unit)) for each in one.placed)
