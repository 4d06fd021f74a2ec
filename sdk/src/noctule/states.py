"""A state on the bus as a reader keeps up with it: the present, each new one, and the present again after an outage."""

from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh
from google.protobuf.message import Message

M = TypeVar("M", bound=Message)


MOST_KEYS = 8192  # more than a site has units, services and tiles of one kind; the oldest of made-up ones go


class StateReader(Generic[M]):
    """Passes on each state once, and none that is older than one already passed on. Used by one thread only.

    Of keys beyond the newest MOST_KEYS it knows nothing any more: their present may be passed on once more.
    """

    def __init__(self, accepted: Callable[[zenoh.Sample], M | None], callback: Callable[[M], None]) -> None:
        """``accepted`` decodes and checks a sample, and returns None where it refuses it."""
        self._accepted, self._callback = accepted, callback
        self._asked = 0  # how often the present was asked for
        # By key, the hash of the payload that was passed on last, and `asked` when that was published; -1 for a reply.
        self._last: dict[str, tuple[int, int]] = {}

    def asking(self) -> None:
        """The present is asked for now: only what is published from here on is newer than the replies."""
        self._asked += 1

    def on_published(self, sample: zenoh.Sample) -> bool:
        """A new state; returns whether it was passed on."""
        return self._pass_on(sample, published=True)

    def on_present(self, sample: zenoh.Sample) -> bool:
        """A reply to the question for the present; returns whether it was passed on."""
        if (last := self._last.get(str(sample.key_expr))) is not None:
            passed_on, asked = last
            if asked == self._asked or passed_on == hash(sample.payload.to_bytes()):
                return False
        return self._pass_on(sample, published=False)

    def _pass_on(self, sample: zenoh.Sample, published: bool) -> bool:
        message = self._accepted(sample)
        if message is None:
            return False
        key = str(sample.key_expr)
        self._last.pop(key, None)  # so that the newest stands last
        self._last[key] = hash(sample.payload.to_bytes()), self._asked if published else -1
        if len(self._last) > MOST_KEYS:
            del self._last[next(iter(self._last))]
        self._callback(message)
        return True
