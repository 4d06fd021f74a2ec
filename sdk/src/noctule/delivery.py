"""Callbacks on a thread of their own, fed by a bounded queue: a slow callback never holds up the bus."""

import logging
import queue
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

HELD_BYTES = 2**28  # of messages that wait; the largest grid that rooms have is a tenth of it

_log = logging.getLogger(__name__)


class Delivery:
    """Runs what it is given, in order, on one thread; what finds the queue full is dropped and counted.

    It is full with ``capacity`` calls, or where their messages have ``most_bytes`` together.
    """

    def __init__(self, name: str, capacity: int, most_bytes: int = HELD_BYTES) -> None:
        self._queue: queue.Queue[tuple[Callable[[], bool], int] | None] = queue.Queue(capacity)
        self._most_bytes, self._bytes = most_bytes, 0
        self._counting = threading.Lock()
        self._counts: Counter[str] = Counter(delivered=0, dropped=0, failed=0)
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, call: Callable[[], bool], size_bytes: int = 0) -> None:
        """Have ``call`` made soon, which returns whether it delivered anything; never waits.

        ``size_bytes`` is that of its message. One message always has room: who is called says whether it is too large.
        """
        try:
            with self._counting:
                if self._bytes and self._bytes + size_bytes > self._most_bytes:
                    raise queue.Full
                self._queue.put_nowait((call, size_bytes))
                self._bytes += size_bytes
        except queue.Full:
            self._counts["dropped"] += 1
            if self._counts["dropped"] == 1:
                _log.warning(
                    "%s: callbacks are too slow and the queue is full; messages are dropped", self._thread.name
                )

    def counters(self) -> dict[str, int]:
        """How many calls were ``delivered``, ``dropped`` for want of room, or ``failed`` by raising."""
        return dict(self._counts)

    def close(self) -> None:
        """Make no more calls; waits for the one that is being made, unless it is that one which closes."""
        self._closed = True
        if threading.current_thread() is self._thread:
            return
        with suppress(queue.Full):  # then the thread sees the flag after its present call
            self._queue.put_nowait(None)
        self._thread.join()

    def _run(self) -> None:
        while (waiting := self._queue.get()) is not None and not self._closed:
            call, size_bytes = waiting
            with self._counting:
                self._bytes -= size_bytes
            try:
                self._counts["delivered"] += call()
            except Exception:  # a panic of Zenoh is none, breaks the session for good, and so ends the thread
                self._counts["failed"] += 1
                _log.exception("%s: a callback raised; its message is lost to it", self._thread.name)
