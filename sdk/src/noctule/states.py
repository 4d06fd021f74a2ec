"""A state on the bus as a reader keeps up with it: the present, each new one, and the present again after an outage."""

from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh
from google.protobuf.message import Message

M = TypeVar("M", bound=Message)


class StateReader(Generic[M]):
    """Passes on each state once, and none that is older than one already passed on. Used by one thread only."""

    def __init__(self, accepted: Callable[[zenoh.Sample], M | None], callback: Callable[[M], None]) -> None:
        """``accepted`` decodes and checks a sample, and returns None where it refuses it."""
        self._accepted, self._callback = accepted, callback
        self._published: set[str] = set()  # keys with a publication since the present was last asked for
        self._last: dict[str, int] = {}  # by key, the hash of the payload that was passed on last

    def asking(self) -> None:
        """The present is asked for now: only what is published from here on is newer than the replies."""
        self._published.clear()

    def on_published(self, sample: zenoh.Sample) -> bool:
        """A new state; returns whether it was passed on."""
        return self._pass_on(sample, published=True)

    def on_present(self, sample: zenoh.Sample) -> bool:
        """A reply to the question for the present; returns whether it was passed on."""
        key = str(sample.key_expr)
        if key in self._published or self._last.get(key) == hash(sample.payload.to_bytes()):
            return False
        return self._pass_on(sample, published=False)

    def _pass_on(self, sample: zenoh.Sample, published: bool) -> bool:
        message = self._accepted(sample)
        if message is None:
            return False
        key = str(sample.key_expr)
        if published:
            self._published.add(key)
        self._last[key] = hash(sample.payload.to_bytes())
        self._callback(message)
        return True
