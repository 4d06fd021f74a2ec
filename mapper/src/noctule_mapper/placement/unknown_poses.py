"""Where units stand whose poses nobody has stated, by the walls that they share with units whose poses are known.

Unit by unit, the surest first, each against the map of those that stand already. Several hypotheses of where all the
units stand are followed side by side: a unit that is not sure of its place by one view becomes so by the others'. Then
all poses and landmarks together (least squares). Where a room cannot tell (a rectangle turned by half, a square by a
quarter, a corridor's length: Krekovic, Dokmanic and Vetterli 2016) the hypotheses stay alike and the pose stays open.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.landmarks import PlacedUnit, landmarks_of
from noctule_mapper.placement.pose_adjustment import adjusted, grouped
from noctule_mapper.placement.pose_search import Standing, standings
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped

MARGIN_NATS = 10.0  # by which a pose must stand above all others together; wrong ones have been seen at 8
_MOST_HYPOTHESES = 3
_MOST_BRANCHES = 3
_LAST_ROUNDS = 3  # of telling again which plateaus belong together, and adjusting
_HOPELESS_NATS = 12.0  # below the best
_MOST_POSITION_SIGMA_M, _MOST_HEADING_SIGMA_RAD = 0.03, np.radians(1.3)
_SAME_M, _SAME_RAD = 0.15, np.radians(6.0)


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


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    """Where units stand, those that nobody else hears left out, and what all this is worth in nats. ``waiting`` have
    not been looked for.
    """

    placed: tuple[PlacedUnit, ...]
    waiting: tuple[UnitView, ...]
    worth_nats: float

    def pose_of(self, unit: str) -> np.ndarray | None:
        return next((one.pose for one in self.placed if one.view.unit == unit), None)


def find_poses(known: Sequence[PlacedUnit], unknown: Sequence[UnitView]) -> tuple[list[FoundPose], list[OpenPose]]:
    """The poses of the ``unknown`` units that the walls tell, and the units whose poses stay open."""
    if not known:
        return [], [OpenPose(view.unit, "no unit of the site has a known pose") for view in unknown]
    alive, dropped = [_Hypothesis(tuple(known), tuple(unknown), 0.0)], []
    while alive[0].waiting:
        view, found = _surest(alive[0])
        grown = _branches(alive[0], view, found)
        for rival in alive[1:]:
            grown += _branches(rival, view, _standings(rival, view)[0])
        grown.sort(key=lambda one: -one.worth_nats)
        kept = [one for one in grown if one.worth_nats > grown[0].worth_nats - _HOPELESS_NATS][:_MOST_HYPOTHESES]
        # What is dropped keeps its distance to the best.
        dropped = [
            replace(one, worth_nats=one.worth_nats - grown[0].worth_nats) for one in grown[len(kept) :]
        ] + dropped
        alive = [replace(one, placed=tuple(adjusted(one.placed, len(known)))) for one in kept]
    best = alive[0]
    for _ in range(_LAST_ROUNDS if len(best.placed) > len(known) else 0):
        best = replace(best, placed=tuple(adjusted(best.placed, len(known))))
    rivals = [*(replace(one, worth_nats=one.worth_nats - best.worth_nats) for one in alive), *dropped]
    found, left_open = [], []
    for view in unknown:
        placed = next((one for one in best.placed if one.view.unit == view.unit), None)
        margin_nats, rival = _margin(best, rivals, view.unit)
        if placed is not None and margin_nats > MARGIN_NATS and _is_known(placed.covariance):
            found.append(FoundPose(view.unit, placed.pose, placed.covariance))
        else:
            left_open.append(OpenPose(view.unit, _why(placed, margin_nats, rival)))
    return found, left_open


def _standings(hypothesis: _Hypothesis, *views: UnitView) -> list[list[Standing]]:
    """Where each of the units may stand by the map of those that stand already."""
    marks = landmarks_of(hypothesis.placed, grouped(hypothesis.placed))
    return [standings(view, marks, hypothesis.placed) for view in views]


def _surest(hypothesis: _Hypothesis) -> tuple[UnitView, list[Standing]]:
    """The unit that waits whose best pose stands out most, and where it may stand."""
    found = _standings(hypothesis, *hypothesis.waiting)
    worth = [[one.worth_nats for one in each] for each in found]
    margins = [each[0] - np.logaddexp.reduce([*each[1:], 0.0]) if each else -np.inf for each in worth]
    surest = int(np.argmax(margins))
    return hypothesis.waiting[surest], found[surest]


def _branches(hypothesis: _Hypothesis, view: UnitView, found: Sequence[Standing]) -> list[_Hypothesis]:
    """The hypothesis with the unit at each of the places where it may stand, and without it."""
    waiting = tuple(one for one in hypothesis.waiting if one is not view)
    return [
        _Hypothesis(hypothesis.placed, waiting, hypothesis.worth_nats),
        *(_with(hypothesis, view, standing, waiting) for standing in found[:_MOST_BRANCHES]),
    ]


def _with(hypothesis: _Hypothesis, view: UnitView, standing: Standing, waiting: tuple[UnitView, ...]) -> _Hypothesis:
    placed = *hypothesis.placed, PlacedUnit(view, standing.pose, standing.covariance)
    return _Hypothesis(placed, waiting, hypothesis.worth_nats + standing.worth_nats)


def _margin(best: _Hypothesis, all_: Sequence[_Hypothesis], unit: str) -> tuple[float, np.ndarray | None]:
    """By how many nats the hypotheses that have the unit where the best has it stand above those that have it elsewhere
    or nowhere, and where the best of these has it.
    """
    pose, alike, others = best.pose_of(unit), [], []
    for one in all_:
        if any(view.unit == unit for view in one.waiting):
            continue
        (alike if _is_same(one.pose_of(unit), pose) else others).append(one)
    if not others:
        return np.inf, None
    above, below = (float(np.logaddexp.reduce([one.worth_nats for one in group])) for group in (alike, others))
    return above - below, max(others, key=lambda one: one.worth_nats).pose_of(unit)


def _is_same(first: np.ndarray | None, second: np.ndarray | None) -> bool:
    if first is None or second is None:
        return first is second
    off_m, off_rad = np.hypot(*(first - second)[:2]), abs(wrapped(first[2] - second[2]))
    return bool(off_m < _SAME_M and off_rad < _SAME_RAD)


def _is_known(covariance: np.ndarray) -> bool:
    position_m = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return bool(position_m < _MOST_POSITION_SIGMA_M and np.sqrt(covariance[2, 2]) < _MOST_HEADING_SIGMA_RAD)


def _why(placed: PlacedUnit | None, margin_nats: float, rival: np.ndarray | None) -> str:
    if placed is None or (margin_nats < MARGIN_NATS and rival is None):
        return "it shares too few walls with the units whose poses are known"
    if rival is None or margin_nats > MARGIN_NATS:
        return "the walls that it shares with the known units leave its place open"
    here, there = (f"({x_m:.1f}, {y_m:.1f}) m" for x_m, y_m in (placed.pose[:2], rival[:2]))
    return f"the room looks the same from several places, such as {here} and {there}"
