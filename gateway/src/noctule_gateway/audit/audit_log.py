"""Writes an audit log, on a thread of its own: a disk may hang, and Zenoh's threads and the units' must not wait.

A second thread, which never touches the disk, ends the wait of commands for one that hangs.
"""

import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from time import monotonic

from noctule_gateway.audit.allowance import COMMANDS, KEPT_AT_LEAST_S, Allowance, Budget, Keeping
from noctule_gateway.audit.audit_file import AuditFile, begin_file, last_line
from noctule_gateway.audit.lines import Facts, files
from noctule_gateway.errors import AuditError

MAX_FILES = 1000  # each run of the gateway that records a command begins one
WAIT_S = 2.0  # for a disk that hangs; after that commands are carried out all the same

_LOOK_EVERY_S = 0.2
_MAX_WAITING = 10_000
_MAX_AT_ONCE = 256
_CEILING = 2  # times the limits; not even files younger than KEPT_AT_LEAST_S are kept beyond

_log = logging.getLogger(__name__)

Recorded = Future[Budget | None]


@dataclass(frozen=True)
class _Entry:
    """A line on its way: what pays for it, and who waits for it."""

    line: Facts
    payer: Budget | None
    recorded: Recorded = field(default_factory=Recorded)


class AuditLog:
    """Records what is commanded, or refused, in ``folder``. All methods but close() may be called from any thread.

    ``recorded`` counts the lines since the log's birth, those of deleted files too; ``lost`` counts what could not be
    written in this run, or not within WAIT_S.
    ``whose`` stands in the first line of each file. ``now_s`` is a clock that never goes back.
    """

    def __init__(
        self,
        folder: Path,
        whose: Facts,
        keeping: Keeping = COMMANDS,
        now_s: Callable[[], float] = monotonic,
    ) -> None:
        self._folder, self._whose = folder, whose
        self._keeping, self._now_s = keeping, now_s
        self._allowance = Allowance(keeping, now_s)
        self.recorded, self._hash = last_line(folder, keeping.family)
        self.lost = 0
        self._trouble = ""
        self._file: AuditFile | None = None
        self._lock = threading.Lock()
        self._waited_for: deque[tuple[float, _Entry]] = deque()
        self._waiting: queue.Queue[_Entry | None] = queue.Queue(_MAX_WAITING)
        self._thread = threading.Thread(target=self._run, name="audit", daemon=True)
        self._thread.start()
        self._closed = threading.Event()
        threading.Thread(target=self._lose_patience, name="audit patience", daemon=True).start()

    def append(self, facts: Facts, payer: Budget | None = None) -> "Future[Budget | None]":
        """Record ``facts`` and the time. Never waits; the result comes when they are on the disk.

        It is an AuditError where they can't be, or where that takes longer than WAIT_S. What comes too fast is only
        counted, and its result comes at once: None. Else the result is what pays for the line, the ``payer`` of the
        line that tells the outcome.
        """
        with self._lock:
            entry = self._entry(facts, self._allowance.admit(facts, payer))
            if entry.payer is None:
                entry.recorded.set_result(None)
                return entry.recorded
            self._waited_for.append((monotonic() + WAIT_S, entry))
        self._put_in_queue(entry)
        return entry.recorded

    def _entry(self, facts: Facts, payer: Budget | None) -> _Entry:
        return _Entry({"time": datetime.now(UTC).isoformat(timespec="milliseconds")} | facts, payer)

    def _put_in_queue(self, entry: _Entry) -> None:
        try:
            self._waiting.put_nowait(entry)
        except queue.Full:
            full = "too much waits to be written"
            self._settle([entry], AuditError(full), f"{self._keeping.records} are not recorded: {full}")

    def _tell_sum(self, by_s: float) -> None:
        """Record how many lines were only counted, if that is due ``by_s``."""
        with self._lock:
            told = self._allowance.take_sum(by_s)
        if told is not None:
            self._put_in_queue(self._entry(told, None))

    @property
    def summed_up(self) -> int:
        """How many lines came too fast to be written one by one."""
        return self._allowance.counted

    @property
    def detail(self) -> str:
        """What is wrong, for the operator; empty if nothing is."""
        return self._trouble

    def end(self) -> None:
        """Write what waits, and no more. Never waits: close() does."""
        self._tell_sum(by_s=inf)
        with suppress(queue.Full):
            self._waiting.put_nowait(None)

    def close(self, by_s: float) -> None:
        """Wait for the end after end(), until ``by_s`` (monotonic); a disk that hangs then is left behind."""
        self._thread.join(max(0.0, by_s - monotonic()))
        self._closed.set()
        if self._thread.is_alive():
            _log.warning(
                "the disk of %s hangs: the last %s may not be in the %s",
                self._folder,
                self._keeping.records,
                self._keeping.name,
            )

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

    def _write(self, batch: list[_Entry]) -> None:
        if not batch:
            return
        error, trouble = None, ""
        try:
            self._put([entry.line for entry in batch])
        except OSError as failed:
            self._leave_file()
            error = AuditError(f"{self._folder}: {failed.strerror or failed}")
            advice = "make room there, and see that it can be written to"
            trouble = f"{self._keeping.records} are not recorded ({error}): {advice}"
        self._settle(batch, error, trouble)

    def _put(self, batch: list[Facts]) -> None:
        if self._file is not None and (
            self._file.size_bytes > self._keeping.max_file_bytes or not self._file.is_there()
        ):
            self._leave_file()
        if self._file is None:
            self._make_room()
            self._file = begin_file(self._folder, self._keeping.family, self._whose, self.recorded, self._hash)
            _log.info("it is recorded in %s, after line %d, %s", self._file.path, self.recorded, self._hash)
        self._file.append(batch)
        self.recorded, self._hash = self._file.number, self._file.hash

    def _make_room(self) -> None:
        """Delete the oldest files, so that all together keep the limits.

        The allowance lets no flood fill them within KEPT_AT_LEAST_S, but a gateway that starts again and again begins
        with a fresh one. So a young file stays until twice the limits are reached. Age alone deletes nothing: the
        host's clock may be wrong.
        """
        present = [(path, path.stat()) for _, path in files(self._folder, self._keeping.family)]
        total = sum(stat.st_size for _, stat in present) + self._keeping.max_file_bytes
        while present and (filled := max(total / self._keeping.max_bytes, (len(present) + 1) / MAX_FILES)) > 1:
            path, stat = present.pop(0)
            if time.time() - stat.st_mtime < KEPT_AT_LEAST_S and filled <= _CEILING:
                return
            _log.warning(
                "%s is deleted to make room: copy the folder in time to keep all %s", path, self._keeping.records
            )
            path.unlink()
            total -= stat.st_size

    def _lose_patience(self) -> None:
        late = f"the disk of {self._folder} has not answered for {WAIT_S:g} s"
        while not self._closed.wait(_LOOK_EVERY_S):
            self._tell_sum(by_s=self._now_s())
            now_s = monotonic()
            with self._lock:
                overdue = []
                while self._waited_for and self._waited_for[0][0] <= now_s:
                    overdue.append(self._waited_for.popleft()[1])
            if any(not entry.recorded.done() for entry in overdue):
                self._settle(overdue, AuditError(late), f"{self._keeping.records} are recorded late, if at all: {late}")

    def _settle(self, entries: Sequence[_Entry], error: AuditError | None, trouble: str) -> None:
        """End what still waits of ``entries``: with ``trouble`` in one step, because two threads do this."""
        with self._lock:
            waiting = [entry for entry in entries if not (entry.recorded.running() or entry.recorded.done())]
            for entry in waiting:
                # It is this thread's now; callbacks are called without the lock
                entry.recorded.set_running_or_notify_cancel()
            self.lost += len(waiting) if error else 0
            if waiting or not trouble:
                self._tell(trouble)
        for entry in waiting:
            if error is None:
                entry.recorded.set_result(entry.payer)
            else:
                entry.recorded.set_exception(error)

    def _tell(self, trouble: str) -> None:
        if trouble and trouble != self._trouble:
            _log.error("%s", trouble)
        self._trouble = trouble
