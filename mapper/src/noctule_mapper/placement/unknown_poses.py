"""Where units stand whose poses nobody has stated, by the walls that they share with units whose poses are known.

Many hypotheses of where all the units stand are followed side by side (``joint_search``), then the best one is adjusted
as a whole (least squares). A pose is found when the hypotheses that have it stand far above all others, when it still
does if the other units stand as they are, and when no arrangement comes near in which a unit is held at another of its
places and the others follow (``challengers``). Where a room cannot tell (a rectangle turned by half, a square by a
quarter, a corridor's length: Krekovic, Dokmanic and Vetterli 2016) the hypotheses stay alike and the pose stays open.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, is_same
from noctule_mapper.placement.hypothesis_worth import settled
from noctule_mapper.placement.joint_search import search
from noctule_mapper.placement.joint_worth import joint_nats
from noctule_mapper.placement.landmarks import landmarks_of
from noctule_mapper.placement.one_by_one import challengers, margin_alone
from noctule_mapper.placement.pairs import Pairs
from noctule_mapper.placement.pose_adjustment import grouped
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView
from noctule_mapper.readings.angles import wrapped

# A pose must stand out by two margins: among the arrangements of all units, and with all other units where they are.
# These err in different ways, so it is their sum that tells right from wrong. A room whose walls are all in one
# right-angled frame looks alike from several sides, and may go on alike where nobody has heard it.
LEAST_MARGIN_NATS = 5.0  # of either
SUM_NATS, SQUARE_SUM_NATS = 16.0, 21.0  # of both
_SQUARE_RAD, _SURE_WALL = np.radians(9.0), 0.9
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
    names = frozenset(one.view.unit for one in known)
    tied_nats = {}
    for part in _parts(placed):
        tied_nats |= dict.fromkeys((one.view.unit for one in part), _tied_nats(part, names, pairs))
    wanted_nats = SQUARE_SUM_NATS if _is_square(placed) else SUM_NATS
    among = {view.unit: _among(best, rivals, view.unit) for view in unknown}
    margins = {
        unit: _Margins(*among[unit], margin_alone(placed, unit, pairs), tied_nats[unit], wanted_nats) for unit in at
    }
    hopeful = [view for view in unknown if view.unit in at and margins[view.unit].suffice(at[view.unit])]
    challenges = [one for view in hopeful for one in challengers(placed, view, unknown, len(known), pairs)]
    placed_nats = joint_nats(placed, len(known))
    for view in hopeful:
        margins[view.unit] = margins[view.unit].challenged(at[view.unit], placed_nats, challenges)
    found, left_open = [], []
    for unit, (_, rival) in among.items():
        if unit in at and margins[unit].suffice(at[unit]):
            found.append(FoundPose(unit, at[unit].pose, at[unit].covariance))
        else:
            left_open.append(OpenPose(unit, margins[unit].why(at[unit]) if unit in at else _why(None, False, rival)))
    return found, left_open


@dataclass(frozen=True)
class _Margins:
    """By how many nats a unit's pose stands out: among all arrangements, where ``rival`` (x_m, y_m, heading_rad) is its
    place in the best of the others, None for nowhere; with all other units where they are; by what ties it to units
    whose poses are known. And how much the first and each of the others must be together.
    """

    among_nats: float
    rival: np.ndarray | None
    alone_nats: float
    tied_nats: float
    wanted_nats: float

    def suffice(self, at: PlacedUnit) -> bool:
        """The pose is found."""
        return self._stands_out(self.alone_nats) and self._stands_out(self.tied_nats) and _is_known(at.covariance)

    def challenged(self, at: PlacedUnit, placed_nats: float, challenges: Sequence[Hypothesis]) -> "_Margins":
        """The margins beside those of the ``challenges`` that have the unit elsewhere; all units where they are placed
        are worth ``placed_nats``.
        """
        others = [one for one in challenges if not is_same(one.pose_of(at.view.unit), at.pose)]
        best = max(others, key=lambda one: one.worth_nats, default=None)
        if best is None or placed_nats - best.worth_nats >= self.among_nats:
            return self
        return replace(self, among_nats=placed_nats - best.worth_nats, rival=best.pose_of(at.view.unit))

    def why(self, at: PlacedUnit) -> str:
        """Why the pose is not found, in a sentence's part."""
        if self._stands_out(self.alone_nats) and not self._stands_out(self.tied_nats):
            return _ADRIFT
        return _why(at, self.among_nats > self.wanted_nats / 2, self.rival)

    def _stands_out(self, other_nats: float) -> bool:
        both = self.among_nats, other_nats
        return min(both) > LEAST_MARGIN_NATS and sum(both) > self.wanted_nats


def _parts(placed: Sequence[PlacedUnit]) -> list[list[PlacedUnit]]:
    """The units that hear the same reflectors, directly or by way of others: those of other rooms tell them nothing."""
    part = np.arange(len(placed))
    for group in grouped(placed):
        for number, _ in group:
            part[part == part[number]] = part[group[0][0]]
    return [[placed[number] for number in np.nonzero(part == one)[0].tolist()] for one in np.unique(part)]


def _tied_nats(part: Sequence[PlacedUnit], known: Collection[str], pairs: Pairs) -> float:
    """By how much what the units that were looked for hear together tells where a known one is, or what the known ones
    hear where one of these is. Otherwise the units may be right beside one another and wrong beside the known ones.
    """
    stated = [one for one in part if one.view.unit in known]
    sought = [one for one in part if one.view.unit not in known]
    tries = [(one, sought) for one in stated]
    tries += [(one, stated) for one in sought] if len(stated) > 1 else []  # of one alone it is the same question
    margins = (margin_alone([*others, one], one.view.unit, pairs) for one, others in tries if others)
    return max(margins, default=-np.inf)


def _is_square(placed: Sequence[PlacedUnit]) -> bool:
    """Whether all that several units hear and that must be walls is at right angles."""
    marks = landmarks_of(placed, grouped(placed))
    walls = len(marks.alpha_rad)
    sure = (marks.heard_by[:walls] > 1) & (marks.chance[:walls] > _SURE_WALL)
    off_rad = np.abs(wrapped(4 * (marks.alpha_rad[sure][:, None] - marks.alpha_rad[sure]))) / 4
    return bool((off_rad < _SQUARE_RAD).all())


def _among(best: Hypothesis, all_: Sequence[Hypothesis], unit: str) -> tuple[float, np.ndarray | None]:
    """By how many nats the hypotheses that have the unit where the best has it stand above those that have it elsewhere
    or nowhere, and where the best of these has it.
    """
    asked = [one for one in all_ if one.has_looked_for(unit)]
    others = [one for one in asked if not is_same(one.pose_of(unit), best.pose_of(unit))]
    if not others:
        return np.inf, None
    above = np.logaddexp.reduce([one.worth_nats for one in asked if one not in others])
    # Those that were not followed to their end mostly repeat one another: the best stands for them.
    left = max((one.worth_nats for one in others if one.waiting), default=-np.inf)
    below = np.logaddexp.reduce([left, *(one.worth_nats for one in others if not one.waiting)])
    return float(above - below), max(others, key=lambda one: one.worth_nats).pose_of(unit)


def _is_known(covariance: np.ndarray) -> bool:
    position_m = np.sqrt(np.linalg.eigvalsh(covariance[:2, :2])[-1])
    return bool(position_m < _MOST_POSITION_SIGMA_M and np.sqrt(covariance[2, 2]) < _MOST_HEADING_SIGMA_RAD)


def _why(placed: PlacedUnit | None, stands_out: bool, rival: np.ndarray | None) -> str:
    if placed is None or (not stands_out and rival is None):
        return "it shares too few walls with the units whose poses are known"
    if rival is None or stands_out:
        return "the walls that it shares with the known units leave its place open"
    here, there = (f"({x_m:.1f}, {y_m:.1f}) m" for x_m, y_m in (placed.pose[:2], rival[:2]))
    return f"the room looks the same from several places, such as {here} and {there}"
