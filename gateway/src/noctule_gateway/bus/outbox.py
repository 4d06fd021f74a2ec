"""The one thread that puts on the bus: a put may wait for a congested link, and no line or log should wait with it."""

import logging
import queue
import threading
from collections.abc import Callable

import zenoh

_MAX_WAITING = 2000

_log = logging.getLogger(__name__)


class Outbox:
    """Calls what is posted, in order. When too much waits, ``dropped`` counts: sweeps stay in the log, states renew."""

    def __init__(self) -> None:
        self.dropped = 0
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(_MAX_WAITING)
        self._thread = threading.Thread(target=self._run, name="outbox", daemon=True)
        self._thread.start()

    def post(self, put: Callable[[], None]) -> bool:
        """Have ``put`` called; from any thread, never waiting. False where it is dropped."""
        try:
            self._waiting.put_nowait(put)
        except queue.Full:
            self.dropped += 1
            return False
        return True

    def close(self) -> None:
        """Put what waits, and end."""
        self._waiting.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (put := self._waiting.get()) is not None:
            try:
                put()
            except zenoh.ZError as error:
                _log.error("the bus took no message: %s", error)
