"""Writes the audit log, on a thread of its own: a disk may hang, and Zenoh's threads and the units' must not wait.

A second thread, which never touches the disk, ends the wait of commands for one that hangs.
"""

import logging
import queue
import threading
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic

from noctule_gateway.audit.audit_file import AuditFile, begin_file, last_line
from noctule_gateway.audit.lines import Facts, files
from noctule_gateway.errors import AuditError

MAX_FILE_BYTES = 4_000_000
MAX_BYTES = 64_000_000
MAX_FILES = 1000  # each run of the gateway that records a command begins one
WAIT_S = 2.0  # for a disk that hangs; after that commands are carried out all the same

_LOOK_EVERY_S = 0.2
_MAX_WAITING = 10_000
_MAX_AT_ONCE = 256

_log = logging.getLogger(__name__)


class AuditLog:
    """Records what is commanded, in ``folder``. All methods but close() may be called from any thread.

    ``recorded`` counts the lines since the log's birth, those of deleted files too; ``lost`` counts what could not be
    written in this run, or not within WAIT_S. ``whose`` stands in the first line of each file.
    """

    def __init__(
        self,
        folder: Path,
        whose: Facts,
        max_file_bytes: int = MAX_FILE_BYTES,
        max_bytes: int = MAX_BYTES,
    ) -> None:
        self._folder, self._whose = folder, whose
        self._max_file_bytes, self._max_bytes = max_file_bytes, max_bytes
        self.recorded, self._hash = last_line(folder)
        self.lost = 0
        self._trouble = ""
        self._file: AuditFile | None = None
        self._lock = threading.Lock()
        self._waited_for: deque[tuple[float, Future[None]]] = deque()
        self._waiting: queue.Queue[tuple[Facts, Future[None]] | None] = queue.Queue(_MAX_WAITING)
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()
        self._closed = threading.Event()
        threading.Thread(target=self._lose_patience, name="audit patience", daemon=True).start()

    def append(self, facts: Facts) -> "Future[None]":
        """Record ``facts`` and the time. Never waits; the result comes when they are on the disk.

        It is an AuditError where they can't be, or where that takes longer than WAIT_S.
        """
        future: Future[None] = Future()
        with self._lock:
            self._waited_for.append((monotonic() + WAIT_S, future))
        try:
            self._waiting.put_nowait(({"time": datetime.now(UTC).isoformat(timespec="milliseconds")} | facts, future))
        except queue.Full:
            full = "too much waits to be written"
            self._settle([future], AuditError(full), f"commands are not recorded: {full}")
        return future

    @property
    def detail(self) -> str:
        """What is wrong, for the operator; empty if nothing is."""
        return self._trouble

    def close(self, within_s: float = WAIT_S) -> None:
        """Write what waits, and end; a disk that hangs is left behind."""
        with suppress(queue.Full):
            self._waiting.put_nowait(None)
        self._thread.join(within_s)
        self._closed.set()
        if self._thread.is_alive():
            _log.warning("the disk of %s hangs: the last commands may not be in the audit log", self._folder)

    def _run(self) -> None:
        ending = False
        while not ending:
            batch = [self._waiting.get()]
            with suppress(queue.Empty):
                while len(batch) < _MAX_AT_ONCE:
                    batch.append(self._waiting.get_nowait())
            ending = None in batch
            self._write([each for each in batch if each is not None])
        self._leave_file()

    def _leave_file(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _write(self, batch: list[tuple[Facts, "Future[None]"]]) -> None:
        if not batch:
            return
        error, trouble = None, ""
        try:
            self._put([facts for facts, _ in batch])
        except OSError as failed:
            self._leave_file()
            error = AuditError(f"{self._folder}: {failed.strerror or failed}")
            trouble = f"commands are not recorded ({error}): make room there, and see that it can be written to"
        self._settle([future for _, future in batch], error, trouble)

    def _put(self, batch: list[Facts]) -> None:
        if self._file is not None and (self._file.size_bytes > self._max_file_bytes or not self._file.is_there()):
            self._leave_file()
        if self._file is None:
            self._make_room()
            self._file = begin_file(self._folder, self._whose, self.recorded, self._hash)
            _log.info("commands are recorded in %s, after line %d, %s", self._file.path, self.recorded, self._hash)
        self._file.append(batch)
        self.recorded, self._hash = self._file.number, self._file.hash

    def _make_room(self) -> None:
        """Delete the oldest files, so that all together keep the limits."""
        present = [(path, path.stat().st_size) for _, path in files(self._folder)]
        total = sum(size for _, size in present) + self._max_file_bytes
        while present and (total > self._max_bytes or len(present) >= MAX_FILES):
            path, size = present.pop(0)
            _log.warning("%s is deleted to make room: copy the folder in time to keep what was commanded", path)
            path.unlink()
            total -= size

    def _lose_patience(self) -> None:
        late = f"the disk of {self._folder} has not answered for {WAIT_S:g} s"
        while not self._closed.wait(_LOOK_EVERY_S):
            now_s = monotonic()
            with self._lock:
                overdue = []
                while self._waited_for and self._waited_for[0][0] <= now_s:
                    overdue.append(self._waited_for.popleft()[1])
            if any(not future.done() for future in overdue):
                self._settle(overdue, AuditError(late), f"commands are recorded late, if at all: {late}")

    def _settle(self, futures: Sequence["Future[None]"], error: AuditError | None, trouble: str) -> None:
        """End what still waits of ``futures``: with ``trouble`` in one step, because two threads do this."""
        with self._lock:
            waiting = [future for future in futures if not (future.running() or future.done())]
            for future in waiting:
                future.set_running_or_notify_cancel()  # it is this thread's now; callbacks are called without the lock
            self.lost += len(waiting) if error else 0
            if waiting or not trouble:
                self._tell(trouble)
        for future in waiting:
            if error is None:
                future.set_result(None)
            else:
                future.set_exception(error)

    def _tell(self, trouble: str) -> None:
        if trouble and trouble != self._trouble:
            _log.error("%s", trouble)
        self._trouble = trouble
