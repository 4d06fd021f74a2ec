"""Hypotheses of where all units stand together, the likeliest first.

The search begins with the two units that agree best, whether or not one's pose is known, and adds unit by unit, the
surest first; a unit that is not sure of its place by one view becomes so by the others'. Many hypotheses are followed
side by side. The known unit joins like any other; then all of a hypothesis moves into its frame.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, distinct, is_part
from noctule_mapper.placement.hypothesis_worth import lost_nats, under_best, weighed
from noctule_mapper.placement.joint_worth import joint_nats
from noctule_mapper.placement.landmarks import landmarks_of
from noctule_mapper.placement.one_by_one import improved
from noctule_mapper.placement.pairs import Pairs, inverse, moved
from noctule_mapper.placement.pose_adjustment import adjusted, grouped
from noctule_mapper.placement.pose_search import Standing, standings
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView

_MOST_HYPOTHESES = 10
_MOST_WEIGHED = 20  # of which these are chosen
_MOST_BRANCHES = 6
_MOST_COMPLETED = 16  # hypotheses, those that were dropped among them
_MOST_IMPROVED = 8
_HOPELESS_NATS = 14.0  # below the best


def search(known: Sequence[PlacedUnit], unknown: Sequence[UnitView], pairs: Pairs) -> list[Hypothesis]:
    """The hypotheses that were followed to their end, and those that were dropped, the best first; each by its worth
    under the best one's. Of those that were dropped close to the best, it is what they come to at the end, else what
    they were worth when they were dropped.
    """
    root, waiting = _root(known, unknown, pairs)
    alive, order = [Hypothesis(root, grouped(root), waiting, 0.0)], []
    dropped: list[Hypothesis] = []
    fixed = len(root)
    while alive[0].waiting:
        view, found = _surest(alive[0], pairs)
        grown = _branches(alive[0], view, found)
        for rival in alive[1:]:
            grown += _branches(rival, view, _standings(rival, view, pairs))
        grown = distinct(grown)
        top_nats = grown[0].worth_nats
        kept = [one for one in grown if one.worth_nats > top_nats - _HOPELESS_NATS][:_MOST_WEIGHED]
        order.append(view)
        dropped += [replace(one, dropped_nats=top_nats - one.worth_nats) for one in grown[len(kept) :]]
        kept = distinct([_by_joint_worth(_settled(one, fixed), fixed) for one in kept])
        top_nats = kept[0].worth_nats
        alive = [one for one in kept if one.worth_nats > top_nats - _HOPELESS_NATS][:_MOST_HYPOTHESES]
        dropped += [replace(one, dropped_nats=top_nats - one.worth_nats) for one in kept[len(alive) :]]
    alive = [joined(one, order, fixed, pairs) for one in alive]
    ended, left = distinct(alive), []
    for one in sorted(dropped, key=lambda one: one.dropped_nats):
        if one.dropped_nats > _HOPELESS_NATS or len(ended) >= _MOST_COMPLETED:
            left.append(one)
        elif not any(is_part(one, other) for other in ended):
            ended.append(_completed(one, order, fixed, pairs))
    followed = weighed(distinct(ended), fixed)
    more_nats = lost_nats(followed)
    followed = _with_improved(followed, order, fixed, pairs)
    left = [
        replace(one, worth_nats=-one.dropped_nats - more_nats)
        for one in left
        if not any(is_part(one, other) for other in followed)
    ]
    return [_in_frame_of(known, one) for one in [*followed, *left]]


def _with_improved(
    followed: Sequence[Hypothesis], order: Sequence[UnitView], fixed: int, pairs: Pairs
) -> list[Hypothesis]:
    """The hypotheses, the best first, after each unit of the hopeful ones has gone where it is worth most."""
    hopeful = [one for one in followed if one.worth_nats > -_HOPELESS_NATS][:_MOST_IMPROVED]
    return under_best([*(improved(one, order, fixed, pairs) for one in hopeful), *followed[len(hopeful) :]])


def _completed(hypothesis: Hypothesis, order: Sequence[UnitView], fixed: int, pairs: Pairs) -> Hypothesis:
    """The hypothesis with its other units, one after another where each is likeliest."""
    for view in order:
        if view in hypothesis.waiting:
            hypothesis = _settled(hypothesis, fixed)
            branches = _branches(hypothesis, view, _standings(hypothesis, view, pairs)[:1])
            hypothesis = max(branches, key=lambda one: one.worth_nats)
    return joined(hypothesis, order, fixed, pairs)


def joined(hypothesis: Hypothesis, order: Sequence[UnitView], fixed: int, pairs: Pairs) -> Hypothesis:
    """The hypothesis with those units that stood nowhere when they were looked for, as far as all others tell now."""
    while True:
        hypothesis = _settled(hypothesis, fixed)
        names = {one.view.unit for one in hypothesis.placed}
        found = [
            (standing[0].worth_nats, view, standing[0])
            for view in order
            if view.unit not in names and (standing := _standings(hypothesis, view, pairs))
        ]
        best = max(found, key=lambda one: one[0], default=None)
        if best is None or best[0] <= 0:
            return hypothesis
        hypothesis = _with(hypothesis, best[1], best[2], hypothesis.waiting)


def _settled(hypothesis: Hypothesis, fixed: int) -> Hypothesis:
    """The hypothesis with its newest unit's plateaus among the others', and all poses adjusted but the ``fixed``."""
    newest = len(hypothesis.placed) - 1
    units = {number for group in hypothesis.groups for number, _ in group}
    if newest in units or not len(hypothesis.placed[newest].view):
        return hypothesis
    groups = grouped(hypothesis.placed, hypothesis.groups, newest, hypothesis.marks)
    return replace(hypothesis, groups=groups, placed=tuple(adjusted(hypothesis.placed, groups, fixed)))


def _by_joint_worth(hypothesis: Hypothesis, fixed: int) -> Hypothesis:
    """The hypothesis by what its units are worth together, whatever they were worth one after the other."""
    return replace(hypothesis, worth_nats=joint_nats(hypothesis.placed, fixed, hypothesis.groups))


def _root(
    known: Sequence[PlacedUnit], unknown: Sequence[UnitView], pairs: Pairs
) -> tuple[tuple[PlacedUnit, ...], tuple[UnitView, ...]]:
    """Which units the search begins with, and the others."""
    if len(known) > 1 or len(unknown) < 2:
        return tuple(known), tuple(unknown)
    views = [known[0].view, *unknown]
    best, surest_nats = 0, -np.inf
    for number, view in enumerate(views):
        alone = _alone(view)
        marks = landmarks_of([alone], grouped([alone]))
        for other in views[number + 1 :]:
            nats = _sureness_nats(standings(other, marks, [alone], pairs.of(other, view)))
            if nats > surest_nats:
                best, surest_nats = number, nats
    if best == 0:
        return tuple(known), tuple(unknown)
    return (_alone(views[best]),), tuple(view for view in views if view is not views[best])


def _alone(view: UnitView) -> PlacedUnit:
    return PlacedUnit(view, np.zeros(3), np.zeros((3, 3)))


def _sureness_nats(found: Sequence[Standing]) -> float:
    """By how much the best standing is above all others, and above none."""
    worth = [one.worth_nats for one in found]
    return float(worth[0] - np.logaddexp.reduce([*worth[1:], 0.0])) if worth else -np.inf


def _standings(hypothesis: Hypothesis, view: UnitView, pairs: Pairs) -> list[Standing]:
    """Where the unit may stand by the map of those that stand already."""
    return standings(view, hypothesis.marks, hypothesis.placed, pairs.at(view, hypothesis.placed))


def _surest(hypothesis: Hypothesis, pairs: Pairs) -> tuple[UnitView, list[Standing]]:
    """The unit that waits whose best pose stands out most, and where it may stand."""
    found = [_standings(hypothesis, view, pairs) for view in hypothesis.waiting]
    surest = int(np.argmax([_sureness_nats(each) for each in found]))
    return hypothesis.waiting[surest], found[surest]


def _branches(hypothesis: Hypothesis, view: UnitView, found: Sequence[Standing]) -> list[Hypothesis]:
    """The hypothesis with the unit at each of the places where it may stand, and without it."""
    waiting = tuple(one for one in hypothesis.waiting if one is not view)
    return [
        replace(hypothesis, waiting=waiting),
        *(_with(hypothesis, view, standing, waiting) for standing in found[:_MOST_BRANCHES]),
    ]


def _with(hypothesis: Hypothesis, view: UnitView, standing: Standing, waiting: tuple[UnitView, ...]) -> Hypothesis:
    placed = *hypothesis.placed, PlacedUnit(view, standing.pose, standing.covariance)
    return replace(hypothesis, placed=placed, waiting=waiting, worth_nats=hypothesis.worth_nats + standing.worth_nats)


def _in_frame_of(known: Sequence[PlacedUnit], hypothesis: Hypothesis) -> Hypothesis:
    """The hypothesis moved as a whole to where the known units stand; these first. Units that are not with these stand
    nowhere.
    """
    names = [one.view.unit for one in known]
    if hypothesis.placed[: len(known)] and hypothesis.placed[0].view.unit == names[0]:
        return replace(hypothesis, placed=(*known, *hypothesis.placed[len(known) :]))
    here = hypothesis.pose_of(names[0])
    if here is None:
        return replace(hypothesis, placed=tuple(known))
    to_site = moved(known[0].pose, inverse(here)[None])[0]
    others = [
        replace(one, pose=moved(to_site, one.pose[None])[0]) for one in hypothesis.placed if one.view.unit not in names
    ]
    return replace(hypothesis, placed=(*known, *others))
