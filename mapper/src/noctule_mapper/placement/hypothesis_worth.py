"""What hypotheses are worth beside one another, whatever the order in which their units joined.

What a unit was worth when it joined depends on who stood where then. So hypotheses are weighed with the poses to which
all units together have led, unit by unit in one order for all.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from noctule_mapper.placement.hypotheses import Hypothesis, is_same
from noctule_mapper.placement.landmarks import landmarks_of
from noctule_mapper.placement.pose_adjustment import adjusted, grouped
from noctule_mapper.placement.pose_search import standings
from noctule_mapper.placement.reflector_models import PlacedUnit
from noctule_mapper.placement.unit_views import UnitView

_COUNTED_BACK = 5  # of the hypotheses, those nearest to the best
_LAST_ROUNDS = 3  # of telling again which plateaus belong together, and adjusting
_LOST_NATS = -10.0  # of a unit that the others draw away from where it stood
_TELLING = 4  # of those that were dropped, by which the others are judged


def lost_nats(followed: Sequence[Hypothesis]) -> float:
    """How much more than when they were dropped all those are below the best that were followed to their end after all:
    so much, at least, the others would be.
    """
    lost = [-one.worth_nats - one.dropped_nats for one in followed if one.dropped_nats > 0]
    return max(min(lost), 0.0) if len(lost) >= _TELLING else 0.0


def weighed(hypotheses: Sequence[Hypothesis], order: Sequence[UnitView], fixed: int) -> list[Hypothesis]:
    """The hypotheses, the best first, by what each unit is worth where it stands beside those before it in the
    ``order``, and of the closest the same from its other end; the way that is worse for the best one counts. The first
    ``fixed`` poses are known.
    """
    at_rest = [replace(one, placed=settled(one.placed, fixed)) for one in hypotheses]
    chains = []
    for one in at_rest:
        by_unit = {each.view.unit: each for each in one.placed}
        chains.append([by_unit[view.unit] for view in order if view.unit in by_unit])
    forth_nats = np.array([_chain_nats(chain) for chain in chains])
    close, back_nats = np.argsort(-forth_nats)[:_COUNTED_BACK], forth_nats.copy()
    back_nats[close] = [_chain_nats(chains[number][::-1]) for number in close]
    best = close[(forth_nats + back_nats)[close].argmax()]
    over_nats = forth_nats - forth_nats[best]
    over_nats[close] = np.maximum(over_nats[close], back_nats[close] - back_nats[best])
    ranked = [best, *(number for number in np.argsort(-over_nats) if number != best)]
    return [replace(at_rest[number], worth_nats=float(over_nats[number])) for number in ranked]


def settled(placed: tuple[PlacedUnit, ...], fixed: int) -> tuple[PlacedUnit, ...]:
    """The units where their echoes have them together; the first ``fixed`` poses are known."""
    for _ in range(_LAST_ROUNDS if len(placed) > fixed else 0):
        placed = tuple(adjusted(placed, grouped(placed), fixed))
    return placed


def _chain_nats(chain: Sequence[PlacedUnit]) -> float:
    """What the units are worth where they stand, each beside those before it."""
    total_nats, groups = 0.0, grouped(chain[:1])
    for number in range(1, len(chain)):
        before, own = chain[:number], chain[number]
        marks = landmarks_of(before, groups)
        found = standings(own.view, marks, before, own.pose[None])
        total_nats += max((one.worth_nats for one in found if is_same(one.pose, own.pose)), default=_LOST_NATS)
        groups = grouped(chain[: number + 1], groups, number, marks)
    return total_nats
