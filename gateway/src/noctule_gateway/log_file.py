"""The SQLite file of a unit's log: its tables, a commit, retention, reads. log.py gives it a thread.

log_sequence runs without a gap from tail to head, for only the oldest records are ever removed; so what has been
removed since the log's birth is tail - 1, and head outlives every record.
"""

import secrets
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Sweep
from noctule_gateway.clock import HostTime
from noctule_gateway.errors import LogError

_SCHEMA_VERSION = 1
_SCHEMA = """
CREATE TABLE log (log_id TEXT NOT NULL, head INTEGER NOT NULL, size_bytes INTEGER NOT NULL);
CREATE TABLE sweeps (
    log_sequence INTEGER PRIMARY KEY,
    boot INTEGER NOT NULL,
    sequence INTEGER NOT NULL,
    digest BLOB NOT NULL,
    start_tick INTEGER NOT NULL,
    committed_s REAL NOT NULL,
    record BLOB NOT NULL,
    UNIQUE (boot, sequence, digest)
);
"""


@dataclass(frozen=True)
class Retention:
    """How much a log keeps: the oldest records go when the records' bytes or their age (since the commit) pass this."""

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
        try:
            self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        except sqlite3.Error as error:
            raise self._fault("opened", error) from error
        try:
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
            self._prepare()
            self.log_id, self.head, self.size_bytes = self._db.execute("SELECT * FROM log").fetchone()
            self.tail = self._tail(self.head)
        except sqlite3.Error as error:
            self.close()
            raise self._fault("opened", error) from error

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def commit(self, arrivals: Sequence[Arrival], now_s: float, retention: Retention) -> list[Committed]:
        """Append ``arrivals`` in one transaction that is on the disk on return, and remove what retention says."""
        head, size_bytes = self.head, self.size_bytes
        committed = []
        try:
            with self._db:
                self._db.execute("BEGIN IMMEDIATE")
                for arrival in arrivals:
                    result = self._known(arrival) or self._append(arrival, head + 1, now_s)
                    if result.fresh:
                        head += 1
                        size_bytes += len(result.record)
                    committed.append(result)
                size_bytes -= self._trim(size_bytes, now_s, retention)
                self._db.execute("UPDATE log SET head = ?, size_bytes = ?", (head, size_bytes))
                tail = self._tail(head)
        except sqlite3.Error as error:
            raise self._fault("written", error) from error
        self.head, self.size_bytes, self.tail = head, size_bytes, tail
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
        (version,) = self._db.execute("PRAGMA user_version").fetchone()
        if version == _SCHEMA_VERSION:
            return
        if version != 0:
            raise LogError(
                f"log {self._path} has schema {version}, this gateway knows {_SCHEMA_VERSION}; run its own version"
            )
        with self._db:
            self._db.execute("BEGIN IMMEDIATE")
            for statement in _SCHEMA.split(";\n")[:-1]:
                self._db.execute(statement)
            self._db.execute("INSERT INTO log VALUES (?, 0, 0)", (secrets.token_hex(8),))
            self._db.execute(f"PRAGMA user_version = {_SCHEMA_VERSION}")

    def _known(self, arrival: Arrival) -> Committed | None:
        row = self._db.execute(
            "SELECT log_sequence, record FROM sweeps WHERE boot = ? AND sequence = ? AND digest = ?",
            (arrival.sweep.boot, arrival.sweep.sequence, arrival.digest),
        ).fetchone()
        return None if row is None else Committed(*row, fresh=False)

    def _append(self, arrival: Arrival, log_sequence: int, now_s: float) -> Committed:
        sweep = Sweep()
        sweep.CopyFrom(arrival.sweep)
        sweep.log_id, sweep.log_sequence = self.log_id, log_sequence
        record = sweep.SerializeToString()
        self._db.execute(
            "INSERT INTO sweeps VALUES (?, ?, ?, ?, ?, ?, ?)",
            (log_sequence, sweep.boot, sweep.sequence, arrival.digest, arrival.start_tick, now_s, record),
        )
        return Committed(log_sequence, record, fresh=True)

    def _trim(self, size_bytes: int, now_s: float, retention: Retention) -> int:
        """Remove the oldest records that are too much or too old; their bytes."""
        removed_bytes = 0
        last = 0
        rows = self._db.execute("SELECT log_sequence, committed_s, length(record) FROM sweeps ORDER BY log_sequence")
        for log_sequence, committed_s, record_bytes in rows:
            too_much = size_bytes - removed_bytes > retention.max_bytes
            too_old = now_s - committed_s > retention.max_age_s
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
        primary_code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        return LogError(f"log {self._path} can't be {what}: {error}; {_REMEDIES.get(primary_code, _ANY_REMEDY)}")


_DAMAGED = "move the file away: a new log, with a log_id of its own, begins without it"
_REMEDIES = {
    sqlite3.SQLITE_FULL: "make room on the disk",
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_NOTADB: _DAMAGED,
    sqlite3.SQLITE_CANTOPEN: "see that the folder is there and may be written to",
    sqlite3.SQLITE_READONLY: "see that the file may be written to",
    sqlite3.SQLITE_BUSY: "another gateway has it open: only one may serve a unit",
}
_ANY_REMEDY = "see to the disk"
