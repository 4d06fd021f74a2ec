"""A unit's log: every sweep is safe on the disk before the unit may forget it.

One thread writes; what has gathered meanwhile goes into its next transaction, and only then are the callers told. A
fault (full disk) fails the waiting appends and shows in the state; each later append tries again. A damaged log, found
by a commit or a read, is rebuilt on the same thread from what is sound in it.
"""

import contextlib
import logging
import queue
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from threading import TIMEOUT_MAX

from noctule import elapsed
from noctule.elapsed import Instant
from noctule.messages_pb2 import Sweep
from noctule_gateway.errors import DamagedError, LogError
from noctule_gateway.log.log_file import Arrival, Committed, LogFile, Retention
from noctule_gateway.log.log_files import finish_replacing
from noctule_gateway.log.log_reader import LogReader, LogSlice
from noctule_gateway.log.rebuild import rebuild

Done = Callable[[Committed | LogError], None]

_TRIM_EVERY_S = 60.0
_REBUILD_EVERY_S = 60.0  # at most: a disk that spoils all it is given is not filled with copies

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class LogState:
    """What a log holds: log_sequence tail to head. ``error`` says what is wrong with it, empty when all is well."""

    log_id: str = ""
    head: int = 0
    tail: int = 1
    size_bytes: int = 0
    removed: int = 0  # by size or age, since the log's birth
    damaged: int = 0  # sweeps that damage has cost it since then
    damage: str = ""  # what was lately found damaged
    error: str = ""


@dataclass(frozen=True)
class _Found:
    """Damage that a reader found, in the file that was there after so many rebuilds."""

    damage: DamagedError
    rebuilds: int


_Item = tuple[Arrival, Done] | _Found | Callable[[], None] | None  # None: close


class SweepLog:
    """The log at ``path``, made if it is not there. append() and read() may be called from any thread."""

    def __init__(self, path: Path, retention: Retention, now: Callable[[], Instant] = elapsed.now) -> None:
        self._path = path
        self._retention = retention
        self._now = now
        self._state = LogState()
        self._writing: LogFile | None = None
        self._reading: LogReader | None = None
        self._reader = threading.Lock()
        self._rebuilds = 0
        self._rebuilt_at_s = -_REBUILD_EVERY_S
        self._waiting: queue.SimpleQueue[_Item] = queue.SimpleQueue()
        self._commit([])
        self._thread = threading.Thread(target=self._write, name=f"log {path.stem}", daemon=True)
        self._thread.start()

    @property
    def path(self) -> Path:
        """Of the log's file."""
        return self._path

    @property
    def state(self) -> LogState:
        """What the log holds now."""
        return self._state

    def append(self, arrival: Arrival, done: Done) -> None:
        """Commit ``arrival`` and then call ``done``, on the log's own thread, with the record or what went wrong."""
        self._waiting.put((arrival, done))

    def run(self, errand: Callable[[], None]) -> None:
        """Call ``errand`` on the log's own thread, which may wait for the disk, after what was appended before it."""
        self._waiting.put(errand)

    def read(self, first: int, max_records: int, max_bytes: int) -> LogSlice:
        """Committed records from log_sequence ``first`` on, at least one if there is one. Raises LogError."""
        if not self._state.log_id:  # never opened: nobody knows how far it goes
            raise LogError(self._state.error)
        with self._reader, self._reporting_damage():
            found = self._reading_file().read(first, max_records, max_bytes, self._state.head)
        if found.log_id != self._state.log_id:  # another file has been put in its place
            raise LogError(self._state.error or f"log {self._path} was exchanged for another")
        return found

    def last_of_boot(self, boot: int) -> tuple[int, Sweep] | None:
        """Start tick and record of the newest sweep made under ``boot``, a boot_of_life; None if there is none.

        Raises LogError.
        """
        with self._reader, self._reporting_damage():
            return self._reading_file().last_of_boot(boot)

    def close(self, by_s: float = TIMEOUT_MAX) -> None:
        """Commit what waits and close the file, until ``by_s`` (monotonic): a disk that hangs then is left behind."""
        self._waiting.put(None)
        self._thread.join(min(max(0.0, by_s - time.monotonic()), TIMEOUT_MAX))
        if self._thread.is_alive():
            _log.warning("%s: the disk hangs: units send again what is not committed", self._path)

    def _reading_file(self) -> LogReader:
        if self._reading is None:
            self._reading = LogReader(self._path)
        return self._reading

    @contextlib.contextmanager
    def _reporting_damage(self) -> Iterator[None]:
        """Have the writing thread rebuild a log in which a reader has found damage."""
        try:
            yield
        except DamagedError as damage:
            self._waiting.put(_Found(damage, self._rebuilds))
            raise

    def _write(self) -> None:
        closing = False
        while not closing:
            gathered = self._gather()
            closing = None in gathered
            found = [item.damage for item in gathered if isinstance(item, _Found) and item.rebuilds == self._rebuilds]
            appends = [item for item in gathered if isinstance(item, tuple)]
            result = self._commit([arrival for arrival, _ in appends], *found[:1])
            results = iter([result] * len(appends) if isinstance(result, LogError) else result)
            for item in gathered:
                if isinstance(item, tuple):
                    item[1](next(results))
                elif callable(item):
                    item()
        self._stop_reading()
        if self._writing is not None:
            self._writing.close()
            self._writing = None

    def _gather(self) -> list[_Item]:
        """All that waits; nothing after a quiet while, so that age removes records from a quiet log too."""
        gathered = []
        with contextlib.suppress(queue.Empty):
            gathered.append(self._waiting.get(timeout=_TRIM_EVERY_S))
            while True:
                gathered.append(self._waiting.get_nowait())
        return gathered

    def _commit(self, arrivals: list[Arrival], damage: DamagedError | None = None) -> list[Committed] | LogError:
        try:
            if damage is not None:
                self._rebuild(damage)
            try:
                committed = self._commit_to_file(arrivals)
            except DamagedError as found:
                self._rebuild(found)
                committed = self._commit_to_file(arrivals)
        except (LogError, OSError) as error:
            self._abandon()
            if not self._state.error:
                _log.error("%s", error)  # the status may say it for less than a second
            self._state = replace(self._state, error=str(error))
            return error if isinstance(error, LogError) else LogError(f"log {self._path} can't be opened: {error}")
        file = self._writing
        assert file is not None
        self._state = LogState(
            file.log_id, file.head, file.tail, file.size_bytes, file.removed, file.damaged, file.damage
        )
        return committed

    def _commit_to_file(self, arrivals: list[Arrival]) -> list[Committed]:
        now = self._now()
        if self._writing is None:
            with self._no_reader():
                finish_replacing(self._path)
            self._writing = LogFile(self._path, now)
        return self._writing.commit(arrivals, now, self._retention)

    def _rebuild(self, damage: DamagedError) -> None:
        """Replace the file by one that holds what is sound; raises ``damage`` where that was done just now."""
        self._abandon()
        if time.monotonic() < self._rebuilt_at_s + _REBUILD_EVERY_S:
            raise damage
        with self._no_reader():
            done = rebuild(self._path, damage.reason, self._now())
            self._rebuilds += 1
        self._rebuilt_at_s = time.monotonic()
        _log.error("%s", done)

    def _abandon(self) -> None:
        """Close the file. When it is opened again its trouble may be over."""
        if self._writing is not None:
            self._writing.abandon()
            self._writing = None
        self._stop_reading()

    def _stop_reading(self) -> None:
        with self._no_reader():
            pass  # it is opened again by the next read

    @contextlib.contextmanager
    def _no_reader(self) -> Iterator[None]:
        """No reader has the file open, nor opens it: one that still had the file replaced would report its damage."""
        with self._reader:
            if self._reading is not None:
                self._reading.close()
                self._reading = None
            yield
