"""How a command ends by Ctrl-C: between two things that it does, never within one.

A KeyboardInterrupt within a declaration leaves it half done, and threads on a session that is closed. And a
signal that comes just before the main thread falls asleep only ends its sleep if it wakes by itself, for Python
looks for signals then: so nothing that a person may interrupt sleeps for long.
"""

import queue
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

T = TypeVar("T")

EVERY_S = 0.5


@contextmanager
def told_to_end() -> Iterator[threading.Event]:
    """An event that the first SIGINT or SIGTERM sets. The second one is a KeyboardInterrupt, as ever."""
    over = threading.Event()

    def end(_signal: int, _frame: object) -> None:
        if over.is_set():
            raise KeyboardInterrupt
        over.set()

    before = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield over
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def wait(event: threading.Event) -> None:
    """Wait until ``event`` is set."""
    while not event.wait(EVERY_S):
        pass


def get(waiting: "queue.Queue[T]") -> T:
    """The next thing that comes."""
    while True:
        try:
            return waiting.get(timeout=EVERY_S)
        except queue.Empty:
            continue
