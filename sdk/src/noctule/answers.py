"""What a question to all who may answer brings: one that ran out of time is no empty answer."""

from collections.abc import Callable, Iterable, Iterator

import zenoh

from noctule.errors import BusError, SilenceError

_TRIES = 2
_LONGEST_ERROR = 2000  # bytes of a service's own words


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


def all_answers(
    session: zenoh.Session, selector: str, payload: bytes | None, timeout_s: float, attachment: bytes | str
) -> Iterator[zenoh.Sample]:
    """The good replies as they come. Raises BusError if all are errors: another service may know the answer."""
    answered, error = False, None
    # Any other consolidation keeps one reply per key.
    replies = session.get(
        selector,
        payload=payload,
        timeout=timeout_s,
        consolidation=zenoh.ConsolidationMode.NONE,
        attachment=attachment,
    )
    for reply in replies:
        if reply.ok is not None:
            answered = True
            yield reply.ok
        elif reply.err is not None:
            error = error_text(reply.err)
    if error is not None and not answered:
        raise no_answer(selector, error, timeout_s)


def error_text(error: zenoh.ReplyError) -> str:
    """What an error reply says, cut off after 2,000 bytes."""
    return error.payload.to_bytes()[:_LONGEST_ERROR].decode(errors="replace")


def no_answer(selector: str, error: str, timeout_s: float) -> BusError:
    """The error to raise where a question brought nothing but errors, the last of which said ``error``."""
    return BusError(f"{selector}: {error} (waited up to {timeout_s:g} s)")
