"""Where units stand whose poses nobody has stated, by the walls that they share with units whose poses are known.

Many hypotheses of where all the units stand are followed side by side (``joint_search``), then the best one is adjusted
as a whole (least squares). A pose is found when the hypotheses that have it stand far above all others, and when it
still does if the other units stand as they are. Where a room cannot tell (a rectangle turned by half, a square by a
quarter, a corridor's length: Krekovic, Dokmanic and Vetterli 2016) the hypotheses stay alike and the pose stays open.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, is_same
from noctule_mapper.placement.hypothesis_worth import settled
from noctule_mapper.placement.joint_search import search
from noctule_mapper.placement.landmarks import landmarks_of
from noctule_mapper.placement.one_by_one import margin_alone, margin_held
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
    names = frozenset(one.view.unit for one in known)
    alone_nats = {one.view.unit: margin_alone(placed, one.view.unit, pairs) for one in placed[len(known) :]}
    tied_nats = {}
    for part in _parts(placed):
        tied_nats |= dict.fromkeys((one.view.unit for one in part), _tied_nats(part, names, pairs))
    wanted_nats = SQUARE_SUM_NATS if _is_square(placed) else SUM_NATS
    found, left_open = [], []
    for view in unknown:
        at = next((one for one in placed[len(known) :] if one.view.unit == view.unit), None)
        margin_nats, rival = _margin(best, rivals, view.unit)
        if at is None:
            left_open.append(OpenPose(view.unit, _why(at, False, rival)))
            continue
        is_right = _stands_out(margin_nats, alone_nats[view.unit], wanted_nats)
        is_tied = _stands_out(margin_nats, tied_nats[view.unit], wanted_nats)
        if is_right and is_tied and _is_known(at.covariance):
            margin_nats = min(margin_nats, margin_held(placed, view, unknown, len(known), pairs))
            is_right = _stands_out(margin_nats, min(alone_nats[view.unit], tied_nats[view.unit]), wanted_nats)
        if is_right and is_tied and _is_known(at.covariance):
            found.append(FoundPose(view.unit, at.pose, at.covariance))
        else:
            why = _ADRIFT if is_right and not is_tied else _why(at, margin_nats > wanted_nats / 2, rival)
            left_open.append(OpenPose(view.unit, why))
    return found, left_open


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


def _stands_out(among_nats: float, alone_nats: float, wanted_nats: float) -> bool:
    """Whether margins among all arrangements and with all other units where they are suffice."""
    return min(among_nats, alone_nats) > LEAST_MARGIN_NATS and among_nats + alone_nats > wanted_nats


def _is_square(placed: Sequence[PlacedUnit]) -> bool:
    """Whether all that several units hear and that must be walls is at right angles."""
    marks = landmarks_of(placed, grouped(placed))
    walls = len(marks.alpha_rad)
    sure = (marks.heard_by[:walls] > 1) & (marks.chance[:walls] > _SURE_WALL)
    off_rad = np.abs(wrapped(4 * (marks.alpha_rad[sure][:, None] - marks.alpha_rad[sure]))) / 4
    return bool((off_rad < _SQUARE_RAD).all())


def _margin(best: Hypothesis, all_: Sequence[Hypothesis], unit: str) -> tuple[float, np.ndarray | None]:
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
