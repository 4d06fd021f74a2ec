"""Writes an audit log, on a thread of its own: a disk may hang, and Zenoh's threads and the units' must not wait.

A second thread, which never touches the disk, ends the wait of commands for one that hangs.
"""

import json
import logging
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from datetime import UTC, datetime
from math import inf
from pathlib import Path
from time import monotonic

from noctule_gateway.audit.allowance import COMMANDS, KEPT_AT_LEAST_S, SUM_UP_EVERY_S, Allowance, Keeping, Sum
from noctule_gateway.audit.audit_file import AuditFile, begin_file, last_line
from noctule_gateway.audit.lines import Facts, files
from noctule_gateway.errors import AuditError

MAX_FILES = 1000  # each run of the gateway that records a command begins one
WAIT_S = 2.0  # for a disk that hangs; after that commands are carried out all the same

_LOOK_EVERY_S = 0.2
_MAX_WAITING = 10_000
_MAX_AT_ONCE = 256
_BESIDE_FACTS_BYTES = 80  # number and hash of a line
_CEILING = 2  # times the limits; not even files younger than KEPT_AT_LEAST_S are kept beyond

_log = logging.getLogger(__name__)


class AuditLog:
    """Records what is commanded, or refused, in ``folder``. All methods but close() may be called from any thread.

    ``recorded`` counts the lines since the log's birth, those of deleted files too; ``lost`` counts what could not be
    written in this run, or not within WAIT_S; ``summed_up`` counts what came too fast to be written line by line.
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
        self._allowance = Allowance(keeping, now_s())
        self._sum: Sum | None = None
        self.recorded, self._hash = last_line(folder, keeping.family)
        self.lost = self.summed_up = 0
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

        It is an AuditError where they can't be, or where that takes longer than WAIT_S. What comes too fast is only
        counted, and its result comes at once.
        """
        line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds")} | facts
        future: Future[None] = Future()
        with self._lock:
            if not self._allowance.takes(_size(line), self._now_s()):
                self._sum_up(facts)
                future.set_result(None)
                return future
            self._waited_for.append((monotonic() + WAIT_S, future))
        self._put_in_queue(line, future)
        return future

    def _put_in_queue(self, line: Facts, future: "Future[None]") -> None:
        try:
            self._waiting.put_nowait((line, future))
        except queue.Full:
            full = "too much waits to be written"
            self._settle([future], AuditError(full), f"commands are not recorded: {full}")

    def _sum_up(self, facts: Facts) -> None:
        if self._sum is None:
            self._sum = Sum(self._now_s() + SUM_UP_EVERY_S)
            _log.warning(
                "%s-*.jsonl in %s: more comes than can be kept, and is only counted for %g min",
                self._keeping.family,
                self._folder,
                SUM_UP_EVERY_S / 60,
            )
        self._sum.add(facts)
        self.summed_up += 1

    def _tell_sum(self, by_s: float) -> None:
        """Record how many lines were not written one by one, if that is due ``by_s``."""
        with self._lock:
            if self._sum is None or self._sum.due_s > by_s:
                return
            line = {"time": datetime.now(UTC).isoformat(timespec="milliseconds")} | self._sum.facts()
            self._allowance.charge(_size(line), self._now_s())
            self._sum = None
        self._put_in_queue(line, Future())

    @property
    def detail(self) -> str:
        """What is wrong, for the operator; empty if nothing is."""
        return self._trouble

    def close(self, within_s: float = WAIT_S) -> None:
        """Write what waits, and end; a disk that hangs is left behind."""
        self._tell_sum(by_s=inf)
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
            _log.warning("%s is deleted to make room: copy the folder in time to keep what was commanded", path)
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


def _size(line: Facts) -> int:
    return len(json.dumps(line, separators=(",", ":"))) + _BESIDE_FACTS_BYTES
