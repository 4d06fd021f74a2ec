"""What hypotheses are worth beside one another, whatever the order in which their units joined.

What a unit was worth when it joined depends on who stood where then. So hypotheses are weighed as a whole
(``joint_worth``), with the poses to which all units together have led.
"""

from collections.abc import Sequence
from dataclasses import replace

from noctule_mapper.placement.hypotheses import Hypothesis, distinct
from noctule_mapper.placement.joint_worth import joint_nats
from noctule_mapper.placement.pose_adjustment import adjusted, grouped
from noctule_mapper.placement.reflector_models import PlacedUnit

_LAST_ROUNDS = 3  # of telling again which plateaus belong together, and adjusting
_TELLING = 4  # of those that were dropped, by which the others are judged


def lost_nats(followed: Sequence[Hypothesis]) -> float:
    """How much more than when they were dropped all those are below the best that were followed to their end after all:
    so much, at least, the others would be.
    """
    lost = [-one.worth_nats - one.dropped_nats for one in followed if one.dropped_nats > 0]
    return max(min(lost), 0.0) if len(lost) >= _TELLING else 0.0


def weighed(hypotheses: Sequence[Hypothesis], fixed: int) -> list[Hypothesis]:
    """The hypotheses, the best first, by what their units are worth together. The first ``fixed`` poses are known."""
    at_rest = [replace(one, placed=settled(one.placed, fixed)) for one in hypotheses]
    return under_best([replace(one, worth_nats=joint_nats(one.placed, fixed)) for one in at_rest])


def under_best(hypotheses: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Those that differ, the best first, by their worth under the best one's."""
    chosen = distinct(hypotheses)
    return [replace(one, worth_nats=one.worth_nats - chosen[0].worth_nats) for one in chosen]


def settled(placed: tuple[PlacedUnit, ...], fixed: int) -> tuple[PlacedUnit, ...]:
    """The units where their echoes have them together; the first ``fixed`` poses are known."""
    for _ in range(_LAST_ROUNDS if len(placed) > fixed else 0):
        placed = tuple(adjusted(placed, grouped(placed), fixed))
    return placed
