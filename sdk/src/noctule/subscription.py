"""What a client has declared for one callback, to be taken back as one."""

import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import zenoh


class Declared(Protocol):
    """Anything that was declared on a session."""

    def undeclare(self) -> None: ...


class Subscription:
    """One callback's subscription. It lasts until undeclare(), or until its client is closed."""

    def __init__(self, *parts: Declared, forget: Callable[["Subscription"], None]) -> None:
        self._parts, self._forget = parts, forget
        self._lock = threading.Lock()

    def undeclare(self) -> None:
        """Bring no more messages; nothing where this was done before."""
        with self._lock:  # Zenoh's objects can't be undeclared by two threads at a time
            parts, self._parts = self._parts, ()
        for part in parts:
            with suppress(zenoh.ZError):
                part.undeclare()
        self._forget(self)
