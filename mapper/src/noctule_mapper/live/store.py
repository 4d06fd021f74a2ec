"""The mapper's memory: the sweeps of its window and how far it has read each unit's log, in one SQLite file.

What was committed outlives the process at once, and a power cut as soon as the system has written it to the disk. A
sweep's commit does not wait for that: its gateway has it on a disk, and a cursor that a power cut has set back reads it
again. A contour's number is on the disk before anybody sees it, because nothing else would tell that it was used.
"""

import logging
import sqlite3
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import astuple, dataclass
from itertools import groupby
from operator import itemgetter
from pathlib import Path

from noctule import elapsed
from noctule.elapsed import Elapsed, Instant
from noctule.messages_pb2 import Cursor, Sweep
from noctule.sqlite_faults import SQLITE_ERRORS, is_damage
from noctule_mapper.config import Window
from noctule_mapper.live import store_file
from noctule_mapper.live.newest_commit import Newest, NewestCommit
from noctule_mapper.live.store_file import SYNCED, UNSYNCED, StoreError, sealed
from noctule_mapper.readings.faulty import Suspect
from noctule_mapper.readings.sweep import identity_of
from noctule_mapper.window import Identity, SweepWindow

_log = logging.getLogger(__name__)
_VERSIONS_AHEAD = 100  # so many contours after a kill are never numbered, and one in so many waits for the disk
_COPIED_AFTER_COMMITS = 50  # a sweep's changes some 14 pages, and at 1,000 the commits copy the -wal themselves

# Sweeps that broke the map leave the window and stay here, with the reason, as long as they would
# have been in it.
_HELD = """
SELECT log_id, log_sequence, unit, :elapsed_s, :reason, record FROM sweep
WHERE log_id = :log_id AND log_sequence = :log_sequence
"""
_IS_SET_ASIDE = "SELECT 1 FROM set_aside WHERE log_id = ? AND log_sequence = ?"
_TAKE_OUT = "DELETE FROM sweep WHERE log_id = :log_id AND log_sequence = :log_sequence"
_FORGET = """
DELETE FROM set_aside WHERE at_elapsed_s < :elapsed_s - :max_age_s OR rowid NOT IN (
    SELECT rowid FROM set_aside ORDER BY at_elapsed_s DESC, rowid DESC LIMIT :max_sweeps)
"""


@dataclass(frozen=True)
class Change:
    """What a commit did to the window."""

    entered: tuple[Sweep, ...]
    left: tuple[Identity, ...]


class SweepStore:
    """Sweeps of the window by identity, and a cursor per unit. Safe to use from several threads.

    Every method raises StoreError where the file can't be written or read for now, and nothing has changed;
    sqlite3.Error where it is damaged.
    """

    def __init__(self, path: Path, window: Window, now: Callable[[], Instant] = elapsed.now) -> None:
        """Open ``path`` or make it; a damaged one is rebuilt from what is sound in it, which ``damage`` then says.

        Raises StoreError if it is a store of another version, or can't be opened.
        """
        self._path, self._window = path, window
        self._now = now
        self._lock = threading.Lock()
        self._damaged = ""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._database, self.damage = store_file.opened(path, now())
        self._newest_commit, self._notes = NewestCommit(path), True  # whether the last note was written
        self._rows = SweepWindow(self._database, window)
        self._version = self._reserved = 0  # of contours: the last one, and up to which the file has them as used
        self._copier: sqlite3.Connection | None = None
        self._commits = 0  # since the -wal was copied

    def check(self) -> None:
        """Raise RuntimeError if the file was found damaged while in use: the next start rebuilds it."""
        if self._damaged:
            raise RuntimeError(f"the mapper's store is damaged ({self._damaged}): the next start rebuilds it")

    def commit(self, sweeps: Iterable[Sweep], cursors: Iterable[Cursor], suspects: Iterable[Suspect] = ()) -> Change:
        """Take sweeps in, ``suspects`` out, and move the cursors in one transaction; a sweep that is already held
        changes nothing, and one that is suspect by now is not taken in at all, so that it supersedes none.
        """
        found = tuple(suspects)
        with self._transaction() as database:
            now, entered, left = self._now(), dict[Identity, Sweep](), set[Identity]()
            elapsed_s = self._count_to(now)
            for sweep in sweeps:
                if any(suspect.has(sweep) for suspect in found):
                    continue
                superseded = self._enter(database, sweep, elapsed_s)
                if superseded is not None:
                    entered[identity_of(sweep)] = sweep
                    left.update(superseded)
            for suspect in found:
                left.update(self._rows.take_out(suspect))
            database.executemany(
                "INSERT OR REPLACE INTO cursor VALUES (?, ?, ?, ?)",
                [sealed((cursor.unit, cursor.log_id, cursor.log_sequence)) for cursor in cursors],
            )
            left |= {*self._rows.too_old(elapsed_s, round(now.utc_s * 1e9)), *self._rows.too_many()}
        return Change(
            entered=tuple(sweep for identity, sweep in entered.items() if identity not in left),
            left=tuple(identity for identity in left if identity not in entered),
        )

    def set_aside(self, identity: Identity, reason: str) -> None:
        """Take a sweep out of the window for good: it broke the map, and would do so again after a restart."""
        row = dict(zip(("log_id", "log_sequence"), identity, strict=True)) | {"reason": reason}
        limits = {"max_age_s": self._window.max_age_s, "max_sweeps": self._window.max_sweeps}
        with self._transaction() as database:
            now = {"elapsed_s": self._count_to(self._now())}
            held = database.execute(_HELD, row | now).fetchall()
            database.executemany("INSERT OR REPLACE INTO set_aside VALUES (?, ?, ?, ?, ?, ?, ?)", map(sealed, held))
            database.execute(_TAKE_OUT, row)
            self._rows.recount()
            database.execute(_FORGET, limits | now)

    def sweeps_set_aside(self) -> list[tuple[str, Identity, str]]:
        """Unit, identity and reason of each sweep that is set aside, the last one last."""
        with self._transaction() as database:
            rows = database.execute(
                "SELECT unit, log_id, log_sequence, reason FROM set_aside ORDER BY at_elapsed_s, rowid"
            )
            return [(unit, (log_id, sequence), reason) for unit, log_id, sequence, reason in rows.fetchall()]

    def sweeps(self) -> list[Sweep]:
        """The sweeps of the window in the order in which they came, those of one log in that log's order.

        Their times would give another, where a clock was set back.
        """
        with self._transaction() as database:
            rows = database.execute("SELECT log_id, log_sequence, record FROM sweep ORDER BY rowid").fetchall()
        logs = {log_id: iter(list(log)) for log_id, log in groupby(sorted(rows), key=itemgetter(0))}
        return [Sweep.FromString(next(logs[log_id])[2]) for log_id, *_ in rows]

    def cursors(self) -> dict[str, Cursor]:
        """How far each unit's log has been read, by unit."""
        with self._transaction() as database:
            rows = database.execute("SELECT unit, log_id, log_sequence FROM cursor").fetchall()
        return {unit: Cursor(unit=unit, log_id=log_id, log_sequence=sequence) for unit, log_id, sequence in rows}

    def forget(self, unit: str) -> int:
        """Forget a unit's sweeps and cursor, so that its log is read again from its tail; how many sweeps.

        Raises StoreError where there is nothing of that unit.
        """
        with self._transaction() as database:
            sweeps, aside, cursors = (
                database.execute(f"DELETE FROM {table} WHERE unit = ?", (unit,)).rowcount
                for table in ("sweep", "set_aside", "cursor")
            )
            self._rows.recount()
        if not sweeps + aside + cursors:
            raise StoreError(f"{self._path} holds nothing of unit {unit!r}")
        return sweeps

    def next_contour_version(self) -> int:
        """A number that no contour of this store has borne yet, greater than all before it. For one thread."""
        if self._version == self._reserved:
            with self._transaction(SYNCED) as database:
                (version,) = database.execute("SELECT version FROM contour").fetchone()
                store_file.note_contours(database, version + _VERSIONS_AHEAD)
            self._version, self._reserved = version, version + _VERSIONS_AHEAD
        self._version += 1
        return self._version

    def checkpoint(self) -> None:
        """Copy what was committed from the -wal into the database, where that is due.

        Called each second by one thread, it spares the commits that work and its waits for the disk.
        """
        if self._commits < _COPIED_AFTER_COMMITS:
            return
        self._commits = 0
        try:
            if self._copier is None:
                self._copier = sqlite3.connect(self._path, isolation_level=None, check_same_thread=False)
            self._copier.execute("PRAGMA wal_checkpoint(PASSIVE)")
            with self._transaction():  # the first commit after it waits for the disk
                self._count_to(self._now())
        except StoreError:
            pass  # the next sweep's commit says it
        except SQLITE_ERRORS as error:
            if is_damage(error):
                self._damaged = str(error)
            else:
                _log.warning("the -wal of %s can't be copied into it: %s; see to its disk", self._path, error)

    def close(self) -> None:
        if self._version < self._reserved:
            with suppress(StoreError, OSError, *SQLITE_ERRORS), self._transaction() as database:
                store_file.note_contours(database, self._version)
                # Before the commit: a note of a higher number than the store's would look like a lost commit.
                self._newest_commit.note(self._newest())
        with self._lock:
            if self._copier is not None:
                self._copier.close()
            self._database.close()
            self._newest_commit.close()

    @contextmanager
    def _transaction(self, durability: str = UNSYNCED) -> Iterator[sqlite3.Connection]:
        with self._lock:
            try:
                self._database.execute(f"PRAGMA synchronous = {durability}")
                self._database.execute("BEGIN IMMEDIATE")
                yield self._database
                newest = self._newest()
                self._database.execute("COMMIT")
                self._commits += 1
                self._note(newest)
            except BaseException as error:
                self._rows.recount()
                if isinstance(error, SQLITE_ERRORS) and is_damage(error):
                    self._damaged = str(error)
                if self._database.in_transaction:  # a disk that is full has rolled it back already
                    self._database.execute("ROLLBACK")
                if isinstance(error, SQLITE_ERRORS) and not is_damage(error):
                    raise self._unusable(error) from error
                raise

    def _newest(self) -> Newest:
        return Newest(*store_file.counts(self._database), self._now().kernel_boot)

    def _note(self, newest: Newest) -> None:
        """Note what is committed. Where that fails nothing is lost, but a lost commit may not be found."""
        try:
            self._newest_commit.note(newest)
        except OSError as error:
            if self._notes:
                _log.warning("the newest commit of %s can't be noted beside it: %s; see to its disk", self._path, error)
            self._notes = False
        else:
            self._notes = True

    def _unusable(self, error: Exception) -> StoreError:
        return StoreError(f"the mapper's store {self._path} can't be used: {error}; see to its disk")

    def _count_to(self, now: Instant) -> float:
        """Seconds that the store has counted at ``now``, written down in the caller's transaction."""
        values = self._database.execute("SELECT seconds, kernel_boot, since_boot_s FROM elapsed").fetchone()
        count = Elapsed(*values).at(now)
        row = sealed(astuple(count))
        self._database.execute("UPDATE elapsed SET seconds = ?, kernel_boot = ?, since_boot_s = ?, checksum = ?", row)
        return count.seconds

    def _enter(self, database: sqlite3.Connection, sweep: Sweep, elapsed_s: float) -> list[Identity] | None:
        """What the sweep supersedes; None if it is there already or set aside."""
        if database.execute(_IS_SET_ASIDE, identity_of(sweep)).fetchone():
            return None
        return self._rows.enter(sweep, sweep.SerializeToString(), elapsed_s)
