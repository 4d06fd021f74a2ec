"""The timetable of a site: which unit may ping when, in UTC, so that none hears another. Pure.

Who could hear whom makes a graph; a greedy colouring gives each unit a number, and units of one number ping together.
A period has as many slots as there are numbers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

# A sound that comes later than 36 ms after ECHO's rise is no echo to the unit (firmware/README.md), and what a ping
# leaves in the room is over after 29 ms: so long the others are silent.
LISTENS_S = 0.036
# The unit pings in a round of 2 ms, which may be late (firmware/README.md, Turns).
LATE_S = 0.003
# ECHO rises 0.45 to 2.3 ms after the trigger, by the copy of the sensor: by so much two units of a room may differ.
LAG_S = 0.002
# So far a unit may drift from its turns before it is given them again.
DRIFTS_S = 0.0005
# What is left is for the errors of two clocks (Turn.clock_error_s).
SHORTEST_SLOT_S = 0.046
MOST_SLOTS = 8  # with more, a sweep would be more than twice as long as alone

_EARLY = 1e-9


@dataclass(frozen=True)
class Pace:
    """How long a unit takes for a reading: to turn and come to rest, for a ping, and from ping to ping of several."""

    turn_s: float
    pings: int = 1
    ping_interval_s: float = 0.06

    @property
    def alone_s(self) -> float:
        """Without turns, if nothing answers."""
        return self.turn_s + (self.pings - 1) * self.ping_interval_s

    def by_turns_s(self, period_s: float) -> float:
        """With turns of this period."""
        periods = _periods(self.turn_s, period_s) + (self.pings - 1) * _periods(self.ping_interval_s, period_s)
        return periods * period_s


@dataclass(frozen=True)
class Turn:
    """A unit's turns: at ``offset_s`` + k ``period_s`` in UTC. ``slot_s`` is how long the others are silent then."""

    offset_s: float
    period_s: float
    slot_s: float

    @property
    def clock_error_s(self) -> float:
        """How large a clock's stated error may be: a third of what the slot leaves for two of them."""
        return (self.slot_s - LISTENS_S - LATE_S - LAG_S - 2 * DRIFTS_S) / 3


@dataclass(frozen=True)
class Crowd:
    """So many units could hear each other that there are no turns for them."""

    units: int


def timetable(paces: Mapping[str, Pace], heard: Mapping[str, Sequence[str]]) -> dict[str, Turn | Crowd]:
    """The turns of the units that could hear others.

    ``heard`` names for each unit those that could hear it and that it could hear, which is symmetric. Units that are
    joined by others that both could hear have one period.
    """
    found: dict[str, Turn | Crowd] = {}
    for group in _groups(heard):
        slot_of = _colours(group, heard)
        slots = max(slot_of.values()) + 1
        if slots > MOST_SLOTS:
            found |= {name: Crowd(len(group)) for name in group}
            continue
        period_s = period([paces[name] for name in group], slots)
        slot_s = period_s / slots
        found |= {name: Turn(slot_of[name] * slot_s, period_s, slot_s) for name in group}
    return found


def period(paces: Sequence[Pace], slots: int) -> float:
    """The period of so many slots or longer by which the unit that loses most loses least."""
    shortest_s = slots * SHORTEST_SLOT_S
    candidates = {shortest_s}
    for pace in paces:
        for whole_s in (pace.turn_s, pace.ping_interval_s):
            candidates |= {whole_s / parts for parts in range(1, int(whole_s / shortest_s) + 1)}
    return min(sorted(candidates), key=lambda each_s: max(one.by_turns_s(each_s) / one.alone_s for one in paces))


def _periods(duration_s: float, period_s: float) -> int:
    return max(1, ceil(duration_s / period_s - _EARLY))


def _groups(heard: Mapping[str, Sequence[str]]) -> list[list[str]]:
    """The units that are joined, of two or more, each in the order of ``heard``."""
    seen: set[str] = set()
    groups = []
    for first in heard:
        joined, waiting = set[str](), [first]
        while waiting:
            name = waiting.pop()
            if name not in joined:
                joined.add(name)
                waiting += heard[name]
        if first not in seen and len(joined) > 1:
            groups.append([name for name in heard if name in joined])
        seen |= joined
    return groups


def _colours(group: Sequence[str], heard: Mapping[str, Sequence[str]]) -> dict[str, int]:
    """A number for each unit that none of those has which it could hear: the lowest, those with most to hear first."""
    colours: dict[str, int] = {}
    for name in sorted(group, key=lambda each: -len(heard[each])):
        taken = {colours[other] for other in heard[name] if other in colours}
        colours[name] = next(number for number in range(len(group)) if number not in taken)
    return colours
