"""Where units stand whose poses nobody has stated, by the walls that they share with units whose poses are known.

Many hypotheses of where all the units stand are followed side by side (``joint_search``), then the best one is adjusted
as a whole (least squares). A pose is found when the hypotheses that have it stand far above all others, and when no
arrangement comes near in which a unit is held at another of its places and the others follow (``challengers``), or in
which all that are sought move as one (``moved_as_one``). Where a room cannot tell (a rectangle turned by half, a square
by a quarter, a corridor's length: Krekovic, Dokmanic and Vetterli 2016) the hypotheses stay alike and the pose stays
open.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, is_same
from noctule_mapper.placement.hypothesis_worth import settled
from noctule_mapper.placement.joint_search import search
from noctule_mapper.placement.joint_worth import joint_nats
from noctule_mapper.placement.one_by_one import challengers, moved_as_one
from noctule_mapper.placement.pairs import Pairs
from noctule_mapper.placement.pose_adjustment import grouped
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView

LEAST_NATS = 12.0  # by which a pose must stand out
_ADRIFT = "it and the units about it share too few walls with those whose poses are known"
_MOST_POSITION_SIGMA_M, _MOST_HEADING_SIGMA_RAD = 0.035, np.radians(1.0)


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
    """The poses of the ``unknown`` units that the walls tell, and the units whose poses stay open. All have names of
    their own.
    """
    if not known:
        return [], [OpenPose(view.unit, "no unit of the site has a known pose") for view in unknown]
    pairs = Pairs()
    rivals = search(known, unknown, pairs)
    best = rivals[0]
    placed = settled(best.placed, len(known))
    at = {one.view.unit: one for one in placed[len(known) :]}
    leads = {view.unit: _among(best, rivals, view.unit) for view in unknown}
    hopeful = [view for view in unknown if view.unit in at and leads[view.unit].suffices()]
    parts = _parts(placed)
    by_unit = [one for view in hopeful for one in challengers(placed, view, unknown, len(known), pairs)]
    moved_parts = parts if hopeful else []
    as_one = [one for part in moved_parts for one in moved_as_one(part, unknown, placed, len(known), pairs)]
    placed_nats = joint_nats(placed, len(known))
    names = {one.view.unit for one in known}
    adrift = {one.view.unit for part in parts if not names & {one.view.unit for one in part} for one in part}
    found, left_open = [], []
    for unit, lead in leads.items():
        if lead.suffices() and unit in at:
            lead = lead.challenged(at[unit], placed_nats, by_unit).challenged(at[unit], placed_nats, as_one, _ADRIFT)
        if unit in at and unit not in adrift and lead.suffices() and _is_known(at[unit].covariance):
            found.append(FoundPose(unit, at[unit].pose, at[unit].covariance))
        else:
            left_open.append(OpenPose(unit, _ADRIFT if unit in adrift else lead.why or _why(at.get(unit), lead)))
    return found, left_open


@dataclass(frozen=True)
class _Lead:
    """By how many nats a unit's pose stands above all arrangements that have it elsewhere, ``rival`` (x_m, y_m,
    heading_rad), its place in the best of these, None for nowhere, and ``why`` these are as good, if that is known.
    """

    nats: float
    rival: np.ndarray | None
    why: str = ""

    def suffices(self) -> bool:
        return self.nats > LEAST_NATS

    def challenged(
        self, at: PlacedUnit, placed_nats: float, challenges: Sequence[Hypothesis], why: str = ""
    ) -> "_Lead":
        """The lead beside the ``challenges`` that have the unit elsewhere; all units where they are placed are worth
        ``placed_nats``.
        """
        others = [one for one in challenges if not is_same(one.pose_of(at.view.unit), at.pose)]
        best = max(others, key=lambda one: one.worth_nats, default=None)
        if best is None or placed_nats - best.worth_nats >= self.nats:
            return self
        return _Lead(placed_nats - best.worth_nats, best.pose_of(at.view.unit), why)


def _parts(placed: Sequence[PlacedUnit]) -> list[list[PlacedUnit]]:
    """The units that hear the same reflectors, directly or by way of others: those of other rooms tell them nothing."""
    part = np.arange(len(placed))
    for group in grouped(placed):
        for number, _ in group:
            part[part == part[number]] = part[group[0][0]]
    return [[placed[number] for number in np.nonzero(part == one)[0].tolist()] for one in np.unique(part)]


def _among(best: Hypothesis, all_: Sequence[Hypothesis], unit: str) -> _Lead:
    """By how many nats the hypotheses that have the unit where the best has it stand above those that have it elsewhere
    or nowhere, and where the best of these has it.
    """
    asked = [one for one in all_ if one.has_looked_for(unit)]
    others = [one for one in asked if not is_same(one.pose_of(unit), best.pose_of(unit))]
    if not others:
        return _Lead(np.inf, None)
    above = np.logaddexp.reduce([one.worth_nats for one in asked if one not in others])
    # Those that were not followed to their end mostly repeat one another: the best stands for them.
    left = max((one.worth_nats for one in others if one.waiting), default=-np.inf)
    below = np.logaddexp.reduce([left, *(one.worth_nats for one in others if not one.waiting)])
    return _Lead(float(above - below), max(others, key=lambda one: one.worth_nats).pose_of(unit))


def _is_known(covariance: np.ndarray) -> bool:
    position_m = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return bool(position_m < _MOST_POSITION_SIGMA_M and np.sqrt(covariance[2, 2]) < _MOST_HEADING_SIGMA_RAD)


def _why(placed: PlacedUnit | None, lead: _Lead) -> str:
    """Why the pose is not found, in a sentence's part."""
    if placed is None or (lead.rival is None and not lead.suffices()):
        return "it shares too few walls with the units whose poses are known"
    if lead.rival is None or lead.suffices():
        return "the walls that it shares with the known units leave its place open"
    here, there = (f"({x_m:.1f}, {y_m:.1f}) m" for x_m, y_m in (placed.pose[:2], lead.rival[:2]))
    return f"the room looks the same from several places, such as {here} and {there}"
