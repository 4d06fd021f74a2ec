"""Where units stand whose poses nobody has stated, found from the walls that they share with units whose poses are known.

Round by round those that stand out, each against the map of those that stand already; then all poses and landmarks together
(least squares), and each unit found once more against the map of all the others. Where a room cannot tell (a rectangle
turned by half, a square by a quarter, a corridor's length: Krekovic, Dokmanic and Vetterli 2016) a pose stays open.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.readings.angles import wrapped
from noctule_mapper.refinement.landmarks import PlacedUnit, landmarks_of
from noctule_mapper.refinement.pose_adjustment import adjusted, grouped
from noctule_mapper.refinement.pose_search import Standing, best_standing
from noctule_mapper.refinement.unit_views import UnitView

MARGIN_NATS = 8.0  # by which a pose must stand above all others together: 1 in 3,000
_MOST_POSITION_SIGMA_M, _MOST_HEADING_SIGMA_RAD = 0.06, np.radians(2.5)


@dataclass(frozen=True)
class FoundPose:
    """A unit's pose (x_m, y_m, heading_rad) and its covariance (3, 3)."""

    unit: str
    pose: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True)
class OpenPose:
    """A unit that has not been found, and why, in a sentence's part."""

    unit: str
    why: str


def find_poses(known: Sequence[PlacedUnit], unknown: Sequence[UnitView]) -> tuple[list[FoundPose], list[OpenPose]]:
    """The poses of the ``unknown`` units that the walls tell, and the units whose poses stay open."""
    placed, waiting = list(known), list(unknown)
    fixed = len(placed)
    standings: dict[str, Standing | None] = {}
    while waiting and placed:
        marks = landmarks_of(placed, grouped(placed))
        standings |= {view.unit: best_standing(view, marks, placed) for view in waiting}
        sure = [view for view in waiting if _is_sure(standings[view.unit])]
        if not sure:
            break
        placed = adjusted([*placed, *(_placed(view, standings[view.unit]) for view in sure)], fixed)
        waiting = [view for view in waiting if view not in sure]
    doubted = [one for one in placed[fixed:] if not _confirmed(one, placed)]
    found = [FoundPose(one.view.unit, one.pose, one.covariance) for one in placed[fixed:] if one not in doubted]
    open_poses = [OpenPose(view.unit, _why(standings.get(view.unit))) for view in waiting]
    return found, [*open_poses, *(OpenPose(one.view.unit, _DOUBTED) for one in doubted)]


_DOUBTED = "its view and those of the other units contradict one another"


def _is_sure(standing: Standing | None) -> bool:
    return standing is not None and standing.margin_nats > MARGIN_NATS and _is_known(standing.covariance)


def _placed(view: UnitView, standing: Standing | None) -> PlacedUnit:
    assert standing is not None
    return PlacedUnit(view, standing.pose, standing.covariance)


def _is_known(covariance: np.ndarray) -> bool:
    position_m = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return bool(position_m < _MOST_POSITION_SIGMA_M and np.sqrt(covariance[2, 2]) < _MOST_HEADING_SIGMA_RAD)


def _confirmed(one: PlacedUnit, placed: Sequence[PlacedUnit]) -> bool:
    """Whether the map of all the others has the unit at the same place, and nowhere else."""
    others = [other for other in placed if other is not one]
    standing = best_standing(one.view, landmarks_of(others, grouped(others)), others)
    if standing is None or standing.margin_nats < MARGIN_NATS:
        return False
    off_m, off_rad = np.hypot(*(standing.pose - one.pose)[:2]), abs(wrapped(standing.pose[2] - one.pose[2]))
    return bool(off_m < _SAME_M and off_rad < _SAME_RAD)


_SAME_M, _SAME_RAD = 0.1, np.radians(4.0)


def _why(standing: Standing | None) -> str:
    if standing is None:
        return "it shares no wall with the units whose poses are known"
    if standing.margin_nats > MARGIN_NATS:
        return "the walls that it shares with the known units leave its place open"
    if standing.rival is None or standing.margin_nats < 0:
        return "it shares too few walls with the units whose poses are known"
    (here, there) = (f"({x_m:.1f}, {y_m:.1f}) m" for x_m, y_m in (standing.pose[:2], standing.rival[:2]))
    return f"the room looks the same from several places, such as {here} and {there}"
