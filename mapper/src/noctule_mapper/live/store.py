"""The mapper's memory: the sweeps of its window and how far it has read each unit's log, in one SQLite file."""

import sqlite3
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import time_ns

from noctule.errors import NoctuleError
from noctule.messages_pb2 import Cursor, Sweep
from noctule_mapper.config import Window
from noctule_mapper.readings.sweep import identity_of
from noctule_mapper.window import Identity, SweepWindow

_SCHEMA = """
CREATE TABLE IF NOT EXISTS cursor (unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS set_aside (
    log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_ns INTEGER NOT NULL,
    reason TEXT NOT NULL, record BLOB NOT NULL,
    PRIMARY KEY (log_id, log_sequence));
CREATE TABLE IF NOT EXISTS contour (version INTEGER NOT NULL);
INSERT INTO contour SELECT 0 WHERE NOT EXISTS (SELECT * FROM contour);
"""
_VERSION = 2
# Sweeps that broke the map leave the window and stay here, with the reason, as long as they would
# have been in it.
_SET_ASIDE = """
INSERT OR REPLACE INTO set_aside SELECT log_id, log_sequence, unit, :now_ns, :reason, record FROM sweep
WHERE log_id = :log_id AND log_sequence = :log_sequence
"""
_IS_SET_ASIDE = "SELECT 1 FROM set_aside WHERE log_id = ? AND log_sequence = ?"
_TAKE_OUT = "DELETE FROM sweep WHERE log_id = :log_id AND log_sequence = :log_sequence"
_FORGET = """
DELETE FROM set_aside WHERE at_ns < :now_ns - :max_age_ns OR rowid NOT IN (
    SELECT rowid FROM set_aside ORDER BY at_ns DESC LIMIT :max_sweeps)
"""


class StoreError(NoctuleError):
    """A store file that can't be used."""


@dataclass(frozen=True)
class Change:
    """What a commit did to the window."""

    entered: tuple[Sweep, ...]
    left: tuple[Identity, ...]


class SweepStore:
    """Sweeps of the window by identity, and a cursor per unit. Safe to use from several threads."""

    def __init__(self, path: Path, window: Window, now_ns: Callable[[], int] = time_ns) -> None:
        """Open ``path`` or make it; raises StoreError if it is not a store of this version."""
        self._window = window
        self._now_ns = now_ns
        self._lock = threading.Lock()
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            self._prepare(path)
        except sqlite3.DatabaseError as error:
            raise StoreError(f"{path} can't be used as the mapper's store ({error}): {_begin_again(path)}") from error

    def commit(self, sweeps: Iterable[Sweep], cursors: Iterable[Cursor]) -> Change:
        """Take sweeps in and move the cursors in one transaction; a sweep that is already held changes nothing."""
        with self._transaction() as database:
            entered: dict[Identity, Sweep] = {}
            left: set[Identity] = set()
            for sweep in sweeps:
                superseded = self._enter(database, sweep)
                if superseded is not None:
                    entered[identity_of(sweep)] = sweep
                    left.update(superseded)
            database.executemany(
                "INSERT OR REPLACE INTO cursor VALUES (?, ?, ?)",
                [(cursor.unit, cursor.log_id, cursor.log_sequence) for cursor in cursors],
            )
            left |= self._shrink()
        return Change(
            entered=tuple(sweep for identity, sweep in entered.items() if identity not in left),
            left=tuple(identity for identity in left if identity not in entered),
        )

    def set_aside(self, identity: Identity, reason: str) -> None:
        """Take a sweep out of the window for good: it broke the map, and would do so again after a restart."""
        row = dict(zip(("log_id", "log_sequence"), identity, strict=True)) | {"reason": reason}
        limits = {"max_age_ns": int(self._window.max_age_s * 1e9), "max_sweeps": self._window.max_sweeps}
        now = {"now_ns": self._now_ns()}
        with self._transaction() as database:
            database.execute(_SET_ASIDE, row | now)
            database.execute(_TAKE_OUT, row)
            database.execute(_FORGET, limits | now)

    def sweeps_set_aside(self) -> list[tuple[str, Identity, str]]:
        """Unit, identity and reason of each sweep that is set aside, the last one last."""
        with self._transaction() as database:
            rows = database.execute("SELECT unit, log_id, log_sequence, reason FROM set_aside ORDER BY at_ns, rowid")
            return [(unit, (log_id, sequence), reason) for unit, log_id, sequence, reason in rows.fetchall()]

    def sweeps(self) -> list[Sweep]:
        """The sweeps of the window, oldest first."""
        with self._transaction() as database:
            rows = database.execute("SELECT record FROM sweep ORDER BY start_ns, log_id, log_sequence").fetchall()
        return [Sweep.FromString(record) for (record,) in rows]

    def cursors(self) -> dict[str, Cursor]:
        """How far each unit's log has been read, by unit."""
        with self._transaction() as database:
            rows = database.execute("SELECT unit, log_id, log_sequence FROM cursor").fetchall()
        return {unit: Cursor(unit=unit, log_id=log_id, log_sequence=sequence) for unit, log_id, sequence in rows}

    def next_contour_version(self) -> int:
        """A number that no contour of this store has borne yet, greater than all before it."""
        with self._transaction() as database:
            return database.execute("UPDATE contour SET version = version + 1 RETURNING version").fetchall()[0][0]

    def close(self) -> None:
        with self._lock:
            self._database.close()

    def _prepare(self, path: Path) -> None:
        self._database.execute("PRAGMA journal_mode = WAL")
        self._database.execute("PRAGMA synchronous = FULL")
        (version,) = self._database.execute("PRAGMA user_version").fetchone()
        if version not in (0, _VERSION):
            raise StoreError(f"{path} has format {version}, this mapper reads {_VERSION}: {_begin_again(path)}")
        self._database.executescript(_SCHEMA)
        self._rows = SweepWindow(self._database, self._window)
        self._database.execute(f"PRAGMA user_version = {_VERSION}")

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield self._database
            except BaseException:
                self._database.execute("ROLLBACK")
                raise
            self._database.execute("COMMIT")

    def _enter(self, database: sqlite3.Connection, sweep: Sweep) -> list[Identity] | None:
        """What the sweep supersedes; None if it is there already or set aside."""
        if database.execute(_IS_SET_ASIDE, identity_of(sweep)).fetchone():
            return None
        return self._rows.enter(sweep, sweep.SerializeToString())

    def _shrink(self) -> set[Identity]:
        """Take out what is too old or too many."""
        return {*self._rows.too_old(self._now_ns()), *self._rows.too_many()}


def _begin_again(path: Path) -> str:
    """What to do about a store that can't be used: its newest commits are in the -wal file alone."""
    return (
        f"stop the mapper, move the whole folder {path.parent} away and start the mapper again; "
        "it reads what the gateways' logs still hold"
    )
