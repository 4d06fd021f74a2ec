"""What a question to all who may answer brings: one that ran out of time is asked again, and is no empty answer."""

from collections.abc import Callable, Iterable

import zenoh

from noctule.errors import SilenceError

_TRIES = 2


def answers(ask: Callable[[], Iterable[zenoh.Reply]], what: str) -> list[zenoh.Sample]:
    """The good replies to ``ask``, which is called again, _TRIES in all, where it brought nothing but errors.

    Raises SilenceError, with ``what`` was asked, where the last one did so too: that nobody has answered in time does
    not mean that nobody is there.
    """
    for _ in range(_TRIES):
        replies = list(ask())
        good = [reply.ok for reply in replies if reply.ok is not None]
        if good or not replies:
            return good
    raise SilenceError(
        f"{what} is not known: the router was asked {_TRIES} times and did not answer in time. It is busy, or was just "
        "restarted: try again"
    )
