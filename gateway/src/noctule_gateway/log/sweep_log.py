"""A unit's log: every sweep is safe on the disk before the unit may forget it.

One thread writes; what has gathered meanwhile goes into its next transaction, and only then are the callers told. A
fault (full disk, damaged file) fails the waiting appends and shows in the state; each later append tries anew.
"""

import contextlib
import logging
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from noctule_gateway.clock import elapsed
from noctule_gateway.clock.elapsed import Instant
from noctule_gateway.clock.regression import HostTime
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_file import Arrival, Committed, LogFile, LogSlice, Retention

Done = Callable[[Committed | LogError], None]

_TRIM_EVERY_S = 60.0

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LogState:
    """What a log holds: log_sequence tail to head. ``error`` says what is wrong with it, empty when all is well."""

    log_id: str = ""
    head: int = 0
    tail: int = 1
    size_bytes: int = 0
    error: str = ""

    @property
    def removed(self) -> int:
        """Records removed by size or age since the log's birth."""
        return self.tail - 1


class SweepLog:
    """The log at ``path``, made if it is not there. append() and read() may be called from any thread."""

    def __init__(self, path: Path, retention: Retention, now: Callable[[], Instant] = elapsed.now) -> None:
        self._path = path
        self._retention = retention
        self._now = now
        self._state = LogState()
        self._writing: LogFile | None = None
        self._reading: LogFile | None = None
        self._reader = threading.Lock()
        self._waiting: queue.SimpleQueue[tuple[Arrival, Done] | None] = queue.SimpleQueue()
        self._commit([])
        self._thread = threading.Thread(target=self._write, name=f"log {path.stem}", daemon=True)
        self._thread.start()

    @property
    def state(self) -> LogState:
        """What the log holds now."""
        return self._state

    def append(self, arrival: Arrival, done: Done) -> None:
        """Commit ``arrival`` and then call ``done``, on the log's own thread, with the record or what went wrong."""
        self._waiting.put((arrival, done))

    def read(self, first: int, max_records: int, max_bytes: int) -> LogSlice:
        """Committed records from log_sequence ``first`` on, at least one if there is one. Raises LogError."""
        with self._reader:
            return self._reading_file().read(first, max_records, max_bytes)

    def last_of_boot(self, boot: int) -> tuple[int, HostTime] | None:
        """Start tick and time (UTC) of the newest sweep made under ``boot``; None if there is none. Raises LogError."""
        with self._reader:
            return self._reading_file().last_of_boot(boot)

    def close(self) -> None:
        """Commit what waits and close the file."""
        self._waiting.put(None)
        self._thread.join()
        self._abandon()

    def _reading_file(self) -> LogFile:
        if self._reading is None:
            self._reading = LogFile(self._path)
        return self._reading

    def _write(self) -> None:
        closing = False
        while not closing:
            gathered = self._gather()
            closing = None in gathered
            appends = [item for item in gathered if item is not None]
            result = self._commit([arrival for arrival, _ in appends])
            for index, (_, done) in enumerate(appends):
                done(result if isinstance(result, LogError) else result[index])

    def _gather(self) -> list[tuple[Arrival, Done] | None]:
        """All that waits; nothing after a quiet while, so that age removes records from a quiet log too."""
        gathered = []
        with contextlib.suppress(queue.Empty):
            gathered.append(self._waiting.get(timeout=_TRIM_EVERY_S))
            while True:
                gathered.append(self._waiting.get_nowait())
        return gathered

    def _commit(self, arrivals: list[Arrival]) -> list[Committed] | LogError:
        try:
            if self._writing is None:
                self._writing = LogFile(self._path)
            committed = self._writing.commit(arrivals, self._now(), self._retention)
        except LogError as error:
            self._abandon()
            if not self._state.error:
                _log.error("%s", error)  # the status may say it for less than a second
            self._state = replace(self._state, error=str(error))
            return error
        file = self._writing
        self._state = LogState(file.log_id, file.head, file.tail, file.size_bytes)
        return committed

    def _abandon(self) -> None:
        """Close the file. When it is opened again its trouble may be over."""
        if self._writing is not None:
            self._writing.close()
            self._writing = None
        with self._reader:
            if self._reading is not None:
                self._reading.close()
                self._reading = None
