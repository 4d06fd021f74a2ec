"""The SQLite file of a unit's log: its tables, a commit, retention, reads. log.py gives it a thread.

log_sequence runs without a gap from tail to head, for only the oldest records are ever removed; so what has been
removed since the log's birth is tail - 1, and head outlives every record.
"""

import contextlib
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Sweep
from noctule_gateway.clock.elapsed import Elapsed, Instant
from noctule_gateway.clock.regression import HostTime
from noctule_gateway.errors import LogError
from noctule_gateway.log import log_schema

FILE_SUFFIXES = ("", "-wal", "-shm")  # SQLite's files of one log: newest commits are in the -wal alone


@dataclass(frozen=True)
class Retention:
    """How much a log keeps: the oldest records go when the records' bytes or their age pass this.

    The age is the time elapsed since the commit, as elapsed.py counts it.
    """

    max_bytes: int = 256 * 2**20
    max_age_s: float = 30 * 86400.0


@dataclass(frozen=True)
class Arrival:
    """A sweep from the line: what tells the unit's resend, and the message, still without log_id and log_sequence.

    The digest is of the frame: boot numbers begin anew in a unit whose flash was erased.
    """

    digest: bytes
    start_tick: int
    sweep: Sweep


@dataclass(frozen=True)
class Committed:
    """A sweep that is on the disk. ``fresh`` is False if it was there before: the unit had sent it again."""

    log_sequence: int
    record: bytes  # the serialised Sweep with its log_id and log_sequence
    fresh: bool


@dataclass(frozen=True)
class LogSlice:
    """Records in the order of log_sequence, and the bounds of the log at that moment; tail is head + 1 when empty."""

    log_id: str
    head: int
    tail: int
    records: tuple[bytes, ...]


class LogFile:
    """An open log. For one thread at a time. Every method raises LogError, and the file is as before."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._written = [path, Path(f"{path}-wal")]
        try:
            self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise self._fault("opened", error) from error
        try:
            self._prepare()
        except sqlite3.Error as error:
            self.close()
            raise self._fault("opened", error) from error
        except LogError:
            self.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def commit(self, arrivals: Sequence[Arrival], now: Instant, retention: Retention) -> list[Committed]:
        """Append ``arrivals`` in one transaction that is on the disk on return, and remove what retention says.

        What is written into a file that has no name any more is lost with this process: that raises LogError too.
        """
        self._check_in_place()
        head, size_bytes, elapsed = self.head, self.size_bytes, self._elapsed.at(now)
        committed = []
        try:
            with self._db:
                self._db.execute("BEGIN IMMEDIATE")
                for arrival in arrivals:
                    result = self._known(arrival) or self._append(arrival, head + 1, now.utc_s, elapsed.seconds)
                    if result.fresh:
                        head += 1
                        size_bytes += len(result.record)
                    committed.append(result)
                size_bytes -= self._trim(size_bytes, elapsed.seconds, retention)
                self._db.execute(
                    "UPDATE log SET head = ?, size_bytes = ?, elapsed_s = ?, kernel_boot = ?, since_boot_s = ?",
                    (head, size_bytes, elapsed.seconds, elapsed.kernel_boot, elapsed.since_boot_s),
                )
                tail = self._tail(head)
        except sqlite3.Error as error:
            raise self._fault("written", error) from error
        self._check_in_place()  # once more: it may have gone meanwhile
        self.head, self.size_bytes, self.tail, self._elapsed = head, size_bytes, tail, elapsed
        return committed

    def read(self, first: int, max_records: int, max_bytes: int) -> LogSlice:
        """Records from log_sequence ``first`` on; at least one, where there is one, whatever ``max_bytes``."""
        records = []
        size_bytes = 0
        try:
            with self._db:
                self._db.execute("BEGIN")
                (head,) = self._db.execute("SELECT head FROM log").fetchone()
                tail = self._tail(head)
                rows = self._db.execute(
                    "SELECT record FROM sweeps WHERE log_sequence >= ? ORDER BY log_sequence LIMIT ?",
                    (first, max_records),
                )
                for (record,) in rows:
                    size_bytes += len(record)
                    if records and size_bytes > max_bytes:
                        break
                    records.append(record)
        except sqlite3.Error as error:
            raise self._fault("read", error) from error
        return LogSlice(self.log_id, head, tail, tuple(records))

    def last_of_boot(self, boot: int) -> tuple[int, HostTime] | None:
        """Start tick and time (UTC) of the newest sweep made under ``boot``; None if there is none."""
        try:
            row = self._db.execute(
                "SELECT start_tick, record FROM sweeps WHERE boot = ? ORDER BY log_sequence DESC LIMIT 1", (boot,)
            ).fetchone()
        except sqlite3.Error as error:
            raise self._fault("read", error) from error
        if row is None:
            return None
        sweep = Sweep.FromString(row[1])
        return row[0], HostTime(sweep.start.ToNanoseconds() / 1e9, sweep.clock_error_s)

    def _prepare(self) -> None:
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        log_schema.prepare(self._db, self._path)
        row = self._db.execute(
            "SELECT log_id, head, size_bytes, elapsed_s, kernel_boot, since_boot_s FROM log"
        ).fetchone()
        if row is None:
            raise sqlite3.DatabaseError("its table log is empty")
        self.log_id, self.head, self.size_bytes = row[:3]
        self._elapsed = Elapsed(*row[3:])
        self.tail = self._tail(self.head)
        self._identities = self._files_at_path()

    def _files_at_path(self) -> list[tuple[int, int] | None]:
        """Which files bear the names of the database and its -wal now."""
        return [_identity(path) for path in self._written]

    def _check_in_place(self) -> None:
        if self._files_at_path() == self._identities:
            return
        # A file that was moved without its -wal is so made whole, and the -wal harms none that was put in its place.
        with contextlib.suppress(sqlite3.Error):
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        raise LogError(
            f"log {self._path} was moved, deleted or replaced under the running gateway: it opens the file again "
            "or begins a new log; stop the gateway before you touch its folder"
        )

    def _known(self, arrival: Arrival) -> Committed | None:
        row = self._db.execute(
            "SELECT log_sequence, record FROM sweeps WHERE boot = ? AND sequence = ? AND digest = ?",
            (arrival.sweep.boot, arrival.sweep.sequence, arrival.digest),
        ).fetchone()
        return None if row is None else Committed(*row, fresh=False)

    def _append(self, arrival: Arrival, log_sequence: int, utc_s: float, elapsed_s: float) -> Committed:
        sweep = Sweep()
        sweep.CopyFrom(arrival.sweep)
        sweep.log_id, sweep.log_sequence = self.log_id, log_sequence
        record = sweep.SerializeToString()
        self._db.execute(
            "INSERT INTO sweeps VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
            (log_sequence, sweep.boot, sweep.sequence, arrival.digest, arrival.start_tick, utc_s, record, elapsed_s),
        )
        return Committed(log_sequence, record, fresh=True)

    def _trim(self, size_bytes: int, elapsed_s: float, retention: Retention) -> int:
        """Remove the oldest records that are too much or too old; their bytes."""
        removed_bytes = 0
        last = 0
        rows = self._db.execute(
            "SELECT log_sequence, committed_elapsed_s, length(record) FROM sweeps ORDER BY log_sequence"
        )
        for log_sequence, committed_elapsed_s, record_bytes in rows:
            too_much = size_bytes - removed_bytes > retention.max_bytes
            too_old = elapsed_s - committed_elapsed_s > retention.max_age_s
            if not (too_much or too_old):
                break
            last = log_sequence
            removed_bytes += record_bytes
        rows.close()
        if last:
            self._db.execute("DELETE FROM sweeps WHERE log_sequence <= ?", (last,))
        return removed_bytes

    def _tail(self, head: int) -> int:
        (tail,) = self._db.execute("SELECT min(log_sequence) FROM sweeps").fetchone()
        return tail or head + 1

    def _fault(self, what: str, error: sqlite3.Error) -> LogError:
        primary_code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
        remedy = _REMEDIES.get(primary_code) or repair_advice(self._path)
        return LogError(f"log {self._path} can't be {what}: {error}; {remedy}")


def repair_advice(path: Path) -> str:
    """What to do about the log at ``path`` where the file itself is the trouble."""
    return (
        f"stop the gateway and run: noctule-gateway repair {path.parent} --unit {path.stem} "
        "(it sets the log aside whole, and a new one begins)"
    )


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino


_REMEDIES = {
    sqlite3.SQLITE_FULL: "make room on the disk",
    sqlite3.SQLITE_IOERR: "see to the disk",
    sqlite3.SQLITE_CANTOPEN: "see that the folder is there and may be written to",
    sqlite3.SQLITE_READONLY: "see that the file may be written to",
    sqlite3.SQLITE_BUSY: "another program has it open: close that",
}
