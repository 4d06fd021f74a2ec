"""The states of a link, and the one table that says which state follows which.

A state says what may be asked of the unit and what is believed of it. What is counted or remembered has no place here:
how many clock exchanges are still missing is in enquiries.py, which orders are still to be given in standing_orders.py.
"""

from enum import Enum, auto


class LinkState(Enum):
    """How far a link has got with its unit."""

    GREETING = auto()
    """Nobody is known to be there: HELLO is asked, and nothing else."""
    IN_LOADER = auto()
    """The unit sits in its loader: HELLO is asked now and again, and nothing else."""
    SYNCING = auto()
    """The unit is identified, its time is not known yet: CLOCK is asked in a row, and no sweep is taken."""
    SETTING_UP = auto()
    """Sweeps are taken; the unit still has to get its standing orders."""
    SERVING = auto()
    """The unit does what is wanted of it."""


class Cause(Enum):
    """What takes a link from one state to the next."""

    LOST = auto()
    """The line was opened or cut or changes hands, the unit is silent, or it is not the one expected."""
    LOADER = auto()
    """The expected unit's loader has spoken."""
    HELLO = auto()
    """The expected unit has said HELLO, under a boot that the link does not serve already."""
    TIME_KNOWN = auto()
    """There were enough CLOCK exchanges."""
    SET_UP = auto()
    """No standing order is left to give."""
    DISTURBED = auto()
    """Somebody else has spoken to the unit: it may not be doing what is wanted of it."""


class TransitionError(RuntimeError):
    """The link's own fault: a cause that can't occur in the state it is in."""


_ANYWHERE = {Cause.LOST: LinkState.GREETING, Cause.LOADER: LinkState.IN_LOADER, Cause.HELLO: LinkState.SYNCING}

TRANSITIONS: dict[LinkState, dict[Cause, LinkState]] = {
    LinkState.GREETING: {**_ANYWHERE, Cause.DISTURBED: LinkState.GREETING},
    LinkState.IN_LOADER: {**_ANYWHERE, Cause.DISTURBED: LinkState.IN_LOADER},
    LinkState.SYNCING: {**_ANYWHERE, Cause.DISTURBED: LinkState.SYNCING, Cause.TIME_KNOWN: LinkState.SETTING_UP},
    LinkState.SETTING_UP: {**_ANYWHERE, Cause.DISTURBED: LinkState.SETTING_UP, Cause.SET_UP: LinkState.SERVING},
    LinkState.SERVING: {**_ANYWHERE, Cause.DISTURBED: LinkState.SETTING_UP},
}

IDENTIFIED = frozenset({LinkState.SYNCING, LinkState.SETTING_UP, LinkState.SERVING})
"""The unit answers, and is the one expected."""
TIME_IS_KNOWN = frozenset({LinkState.SETTING_UP, LinkState.SERVING})
"""Sweeps can be given the time at which they were made."""


def after(state: LinkState, cause: Cause) -> LinkState:
    """The state that follows ``state`` by ``cause``. Raises TransitionError if the table has no such transition."""
    following = TRANSITIONS[state].get(cause)
    if following is None:
        raise TransitionError(f"a link that is {state.name} can't take {cause.name}: report it")
    return following
