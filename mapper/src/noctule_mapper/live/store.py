"""The mapper's memory: the sweeps of its window and how far it has read each unit's log, in one SQLite file."""

import sqlite3
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import tau
from pathlib import Path
from time import time_ns
from typing import Any

from noctule.errors import NoctuleError
from noctule.messages_pb2 import Cursor, Sweep
from noctule_mapper.live.config import Window
from noctule_mapper.readings.sweep import identity_of

Identity = tuple[str, int]
"""As from identity_of(); a log_id is drawn at random, so it names its unit too."""

_SCHEMA = """
CREATE TABLE IF NOT EXISTS sweep (
    unit TEXT NOT NULL, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL,
    start_ns INTEGER NOT NULL, visit INTEGER NOT NULL,
    place_x_m REAL NOT NULL, place_y_m REAL NOT NULL, place_heading_rad REAL NOT NULL,
    record BLOB NOT NULL,
    PRIMARY KEY (unit, log_id, log_sequence));
CREATE INDEX IF NOT EXISTS sweep_by_age ON sweep (start_ns);
CREATE INDEX IF NOT EXISTS sweep_by_place ON sweep (unit, place_x_m, place_y_m, place_heading_rad);
CREATE TABLE IF NOT EXISTS cursor (unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL);
CREATE TABLE IF NOT EXISTS set_aside (
    log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_ns INTEGER NOT NULL,
    reason TEXT NOT NULL, record BLOB NOT NULL,
    PRIMARY KEY (log_id, log_sequence));
CREATE TABLE IF NOT EXISTS contour (version INTEGER NOT NULL);
INSERT INTO contour SELECT 0 WHERE NOT EXISTS (SELECT * FROM contour);
"""
_VERSION = 2
_CLOCKS_DIFFER_NS = 300 * 10**9  # a sweep may be stamped this much ahead of the mapper's host

# Age goes by the newest sweep's time, but for times that the host's clock has not come to: one wrong clock must not
# empty the window. The newest of all is the one that came last, for a clock may be set back.
_TOO_OLD = """
DELETE FROM sweep WHERE start_ns < (SELECT max(start_ns) FROM sweep WHERE start_ns <= :now_ns) - :max_age_ns
RETURNING log_id, log_sequence
"""

# A visit is a stay of one unit at one place, named after the log_sequence of its first sweep, whose pose is the place:
# places so keep their distance from one another, and noise in the poses makes no new ones.
_NEAR = """
unit = :unit AND place_x_m BETWEEN :x_m - :radius_m AND :x_m + :radius_m
AND (place_x_m - :x_m) * (place_x_m - :x_m) + (place_y_m - :y_m) * (place_y_m - :y_m) <= :radius_m * :radius_m
AND min(abs(place_heading_rad - :heading_rad), :full_turn_rad - abs(place_heading_rad - :heading_rad)) <= :turn_rad
"""
_VISIT_BEFORE = f"""
SELECT visit, place_x_m, place_y_m, place_heading_rad FROM (
    SELECT * FROM sweep WHERE unit = :unit AND log_id = :log_id AND log_sequence < :log_sequence
    ORDER BY log_sequence DESC LIMIT 1)
WHERE {_NEAR}
"""
_ENTER = """
INSERT OR IGNORE INTO sweep
SELECT :unit, :log_id, :log_sequence, :start_ns, :visit, :x_m, :y_m, :heading_rad, :record
WHERE NOT EXISTS (SELECT * FROM set_aside WHERE log_id = :log_id AND log_sequence = :log_sequence)
"""
# Of a place, the newest sweeps of its newest visit stay. What came in another log is older.
_SUPERSEDED = f"""
WITH here AS (SELECT rowid AS id, log_id, log_sequence, visit FROM sweep WHERE {_NEAR}),
own AS (SELECT * FROM here WHERE log_id = :log_id)
DELETE FROM sweep WHERE rowid IN (SELECT id FROM here) AND rowid NOT IN (
    SELECT id FROM own WHERE visit = (SELECT max(visit) FROM own)
    ORDER BY log_sequence DESC LIMIT :sweeps_per_place)
RETURNING log_id, log_sequence
"""
_TOO_MANY = """
DELETE FROM sweep WHERE rowid IN (
    SELECT rowid FROM sweep ORDER BY rowid DESC LIMIT -1 OFFSET :max_sweeps)
RETURNING log_id, log_sequence
"""
# Sweeps that broke the map leave the window and stay here, with the reason, as long as they would
# have been in it.
_SET_ASIDE = """
INSERT OR REPLACE INTO set_aside SELECT log_id, log_sequence, unit, :now_ns, :reason, record FROM sweep
WHERE log_id = :log_id AND log_sequence = :log_sequence
"""
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
                row = self._row(database, sweep)
                if database.execute(_ENTER, row).rowcount == 1:
                    entered[identity_of(sweep)] = sweep
                    left.update(database.execute(_SUPERSEDED, row).fetchall())
            database.executemany(
                "INSERT OR REPLACE INTO cursor VALUES (?, ?, ?)",
                [(cursor.unit, cursor.log_id, cursor.log_sequence) for cursor in cursors],
            )
            left |= self._shrink(database)
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

    def _row(self, database: sqlite3.Connection, sweep: Sweep) -> dict[str, Any]:
        """A sweep's row: it belongs to the visit of the sweep before it in its log, or begins a visit where it is."""
        log_id, log_sequence = identity_of(sweep)
        row = {
            "unit": sweep.unit,
            "log_id": log_id,
            "log_sequence": log_sequence,
            "start_ns": sweep.start.ToNanoseconds(),
            "visit": log_sequence,
            "x_m": sweep.pose.x_m,
            "y_m": sweep.pose.y_m,
            "heading_rad": sweep.pose.heading_rad % tau,
            "record": sweep.SerializeToString(),
            "radius_m": self._window.place_radius_m,
            "turn_rad": self._window.place_heading_rad,
            "full_turn_rad": tau,
            "sweeps_per_place": self._window.sweeps_per_place,
        }
        before = database.execute(_VISIT_BEFORE, row).fetchone()
        return row | dict(zip(("visit", "x_m", "y_m", "heading_rad"), before or (), strict=False))

    def _shrink(self, database: sqlite3.Connection) -> set[Identity]:
        """Take out what is too old or too many."""
        age = {"max_age_ns": int(self._window.max_age_s * 1e9), "now_ns": self._now_ns() + _CLOCKS_DIFFER_NS}
        left = set(database.execute(_TOO_OLD, age).fetchall())
        left.update(database.execute(_TOO_MANY, {"max_sweeps": self._window.max_sweeps}).fetchall())
        return left


def _begin_again(path: Path) -> str:
    """What to do about a store that can't be used: its newest commits are in the -wal file alone."""
    return (
        f"stop the mapper, move the whole folder {path.parent} away and start the mapper again; "
        "it reads what the gateways' logs still hold"
    )
