"""Each unit by itself, with all others where they are: whether it should stand elsewhere, and what else comes near."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, is_same
from noctule_mapper.placement.joint_worth import joint_nats
from noctule_mapper.placement.landmarks import Landmarks, landmarks_of
from noctule_mapper.placement.pairs import Pairs, inverse, moved
from noctule_mapper.placement.pose_adjustment import adjusted, grouped
from noctule_mapper.placement.pose_search import Standing, standings
from noctule_mapper.placement.reflector_models import Members, PlacedUnit
from noctule_mapper.placement.unit_views import UnitView

_MOST_ROUNDS = 3
_TRIED_BELOW_NATS = 6.0  # what the one unit makes of a move and what all make of it differ by less, mostly
_LEAST_GAIN_NATS = 0.3  # of a move
_MOST_CHALLENGERS = 2  # other places of one unit at which it is held
_CHALLENGED_BELOW_NATS = 25.0  # a place that is worth less by so much than where the unit stands is not tried


def improved(hypothesis: Hypothesis, views: Sequence[UnitView], fixed: int, pairs: Pairs) -> Hypothesis:
    """The hypothesis after each of ``views`` in turn has gone where all units together are worth more, or nowhere,
    until none gains by that. The first ``fixed`` poses are known. The search misses it where a unit joined early and
    went by the few that stood already.
    """
    began_nats = joint_nats(hypothesis.placed, fixed)
    placed, nats = _improved(hypothesis.placed, began_nats, views, fixed, pairs)
    return replace(hypothesis, placed=placed, worth_nats=hypothesis.worth_nats + nats - began_nats)


def _improved(
    placed: tuple[PlacedUnit, ...], nats: float, views: Sequence[UnitView], fixed: int, pairs: Pairs
) -> tuple[tuple[PlacedUnit, ...], float]:
    """The same of units that are worth ``nats`` where they are placed, with what they are worth then."""
    for _ in range(_MOST_ROUNDS):
        round_nats = nats
        for view in views:
            for other in _moves(placed, view, fixed, pairs):
                other_nats = joint_nats(other, fixed)
                if other_nats > nats + _LEAST_GAIN_NATS:
                    placed, nats = other, other_nats
        if nats == round_nats:
            break
    return placed, nats


def _moves(placed: Sequence[PlacedUnit], view: UnitView, fixed: int, pairs: Pairs) -> Iterator[tuple[PlacedUnit, ...]]:
    """The arrangement with one unit at the best other place, and with it nowhere, where that may be worth more. No unit
    tells one that stands alone to move.
    """
    if all(one.view.unit == view.unit for one in placed):
        return
    around = _others(placed, view.unit)
    here, elsewhere = _standings(placed, view, around, pairs)
    here_nats = max((one.worth_nats for one in here), default=0.0)
    if elsewhere and elsewhere[0].worth_nats > here_nats - _TRIED_BELOW_NATS:
        yield around.with_unit(view, elsewhere[0], fixed)
    if len(placed) > len(around.units) > 1 and here_nats < _TRIED_BELOW_NATS:
        yield tuple(adjusted(around.units, around.groups, fixed))


def challengers(
    placed: Sequence[PlacedUnit], view: UnitView, views: Sequence[UnitView], fixed: int, pairs: Pairs
) -> list[Hypothesis]:
    """The arrangement with the unit held at its best other places, and at last nowhere, after each other of ``views``
    has gone where all are worth more then. In a room that looks alike from several sides the search follows only a few
    of the many arrangements, and may have none of these.
    """
    around = _others(placed, view.unit)
    here, elsewhere = _standings(placed, view, around, pairs)
    least_nats = max((one.worth_nats for one in here), default=0.0) - _CHALLENGED_BELOW_NATS
    rest = [one for one in views if one.unit != view.unit]
    found = []
    for other in elsewhere[:_MOST_CHALLENGERS]:
        if other.worth_nats > least_nats:
            held = around.with_unit(view, other, fixed)
            rival = _followed(held, rest, fixed, pairs)
            if not any(is_same(rival.pose_of(view.unit), one.pose) for one in here):  # it may have been pulled back
                found.append(rival)
    nowhere = tuple(adjusted(around.units, around.groups, fixed))
    return [*found, Hypothesis(nowhere, (), (), joint_nats(nowhere, fixed))]


def moved_as_one(
    part: Sequence[PlacedUnit], views: Sequence[UnitView], placed: Sequence[PlacedUnit], fixed: int, pairs: Pairs
) -> list[Hypothesis]:
    """The arrangement with all units of ``part`` that were looked for moved as one to where a known unit of it fits
    them best otherwise, after each of ``views`` has gone where all are worth more then; and with these units in a place
    of their own, of which no known unit hears anything. They may be right beside one another and wrong beside the known
    one: two walls and their corner alone, which many rooms have, can bind the two together.
    """
    names = {one.view.unit for one in placed[:fixed]}
    sought = [one for one in part if one.view.unit not in names]
    if not sought:
        return []
    rest = [one for one in placed if all(one.view.unit != other.view.unit for other in sought)]
    groups = grouped(sought)
    around = _Others(sought, groups, landmarks_of(sought, groups))
    found = [Hypothesis(tuple(rest), (), (), joint_nats(rest, fixed) + joint_nats(sought, 1))]
    for known in part:
        if known.view.unit in names:
            _, elsewhere = _standings([known], known.view, around, pairs)
            for other in elsewhere[:_MOST_CHALLENGERS]:
                shift = moved(known.pose, inverse(other.pose)[None])[0]
                there = [replace(one, pose=moved(shift, one.pose[None])[0]) for one in sought]
                units = (*rest, *there)
                found.append(_followed(tuple(adjusted(units, grouped(units), fixed)), views, fixed, pairs))
    return found


def _followed(held: tuple[PlacedUnit, ...], views: Sequence[UnitView], fixed: int, pairs: Pairs) -> Hypothesis:
    """The arrangement after each of ``views`` has gone where all are worth more."""
    placed, nats = _improved(held, joint_nats(held, fixed), views, fixed, pairs)
    return Hypothesis(placed, (), (), nats)


@dataclass(frozen=True, eq=False)  # of arrays
class _Others:
    """All units but one, and what they hear together."""

    units: list[PlacedUnit]
    groups: tuple[Members, ...]
    marks: Landmarks

    def with_unit(self, view: UnitView, at: Standing, fixed: int) -> tuple[PlacedUnit, ...]:
        """All units, adjusted together but for the first ``fixed``, with the one where it may stand."""
        units = [*self.units, PlacedUnit(view, at.pose, at.covariance)]
        return tuple(adjusted(units, grouped(units, self.groups, len(self.units), self.marks), fixed))


def _others(placed: Sequence[PlacedUnit], unit: str) -> _Others:
    others = [one for one in placed if one.view.unit != unit]
    groups = grouped(others)
    return _Others(others, groups, landmarks_of(others, groups))


def _standings(
    placed: Sequence[PlacedUnit], view: UnitView, others: _Others, pairs: Pairs
) -> tuple[list[Standing], list[Standing]]:
    """Where a unit may stand by the others, the worthiest first: where it does stand, and elsewhere."""
    own = [one.pose for one in placed if one.view.unit == view.unit]
    starts = np.concatenate([np.reshape(own, (-1, 3)), pairs.at(view, others.units)])
    found = standings(view, others.marks, others.units, starts)
    here = [one for one in found if any(is_same(one.pose, pose) for pose in own)]
    return here, [one for one in found if one not in here]
