"""The SQLite file of a unit's log as its one writer has it: a commit, and retention. sweep_log.py gives it a thread.

log_sequence only ever goes up, also over what was lost (head_file.py says how); only the oldest records are removed by
retention, so head outlives every record.
"""

import contextlib
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from noctule.elapsed import Elapsed, Instant
from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file, log_schema
from noctule_gateway.log.faults import damaged, log_error
from noctule_gateway.log.head_file import HeadFile, Newest
from noctule_gateway.log.log_files import HEADER_BYTES, head_path
from noctule_gateway.log.log_reader import check_rows, newest_differs, read_gaps, read_log, uncovered
from noctule_gateway.log.rows import ALL_COLUMNS, NO_SWEEP, Gap, Log, SweepRow, sealed

_TOLD_FOR_S = 7 * 86400.0  # how long the status names damage

_AT = f"SELECT {ALL_COLUMNS} FROM sweeps NOT INDEXED WHERE log_sequence = ?"
_OLDEST = f"SELECT {ALL_COLUMNS} FROM sweeps NOT INDEXED ORDER BY log_sequence"
_NEWEST = f"{_OLDEST} DESC LIMIT 1"
_KNOWN = "SELECT log_sequence FROM sweeps WHERE boot = ? AND sequence = ? AND digest = ?"
_UPDATE = """UPDATE log SET log_id = ?, head = ?, tail = ?, size_bytes = ?, newest = ?, adopted = ?, elapsed_s = ?,
kernel_boot = ?, since_boot_s = ?, checksum = ?"""


@dataclass(frozen=True)
class Retention:
    """How much a log keeps: the oldest records go when the records' bytes or their age pass this, but for the newest.

    The age is the time elapsed since the commit, as elapsed.py counts it.
    """

    max_bytes: int = 256 * 2**20
    max_age_s: float = 30 * 86400.0


@dataclass(frozen=True)
class Arrival:
    """A sweep from the line: what tells the unit's resend, and the message, still without log_id and log_sequence.

    The digest is of the frame: boot numbers begin again in a unit whose flash was erased.
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


class LogFile:
    """An open log. For one thread at a time. Every method raises LogError, and the file is as before.

    DamagedError: the file holds what was not written there, or its head file does not know it; see rebuild.py.
    """

    def __init__(self, path: Path, now: Instant) -> None:
        self._path = path
        self._written = [path, Path(f"{path}-wal")]
        try:
            self._refuse_lost()
            self._head_file = HeadFile(head_path(path))
        except OSError as error:
            raise self._os_error("opened", error) from error
        try:
            self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
        except SQLITE_ERRORS as error:
            self._head_file.close()
            raise log_error(path, "opened", error) from error
        try:
            self._prepare(now)
        except SQLITE_ERRORS as error:
            self._let_go()
            raise log_error(path, "opened", error) from error
        except OSError as error:
            self._let_go()
            raise self._os_error("opened", error) from error
        except LogError:
            self._let_go()
            raise

    @property
    def log_id(self) -> str:
        return self._log.log_id

    @property
    def head(self) -> int:
        return self._log.head

    @property
    def tail(self) -> int:
        return self._log.tail

    @property
    def size_bytes(self) -> int:
        return self._log.size_bytes

    @property
    def removed(self) -> int:
        """Records that retention has removed since the log's birth."""
        return self.tail - 1 - sum(gap.sequences(1, self.tail - 1) for gap in self._gaps)

    @property
    def damaged(self) -> int:
        """Sweeps that were in this log and are lost, since its birth."""
        return sum(gap.sequences(gap.first, gap.last) for gap in self._gaps if gap.damaged)

    @property
    def damage(self) -> str:
        """What has lately been found damaged, for the operator; empty if nothing."""
        lately = [
            gap for gap in self._gaps if gap.damaged and self._log.elapsed.seconds - gap.found_elapsed_s <= _TOLD_FOR_S
        ]
        if not lately:
            return ""
        last = lately[-1]
        lost = f"{self.damaged} of its sweeps are lost" if self.damaged else "none of its sweeps is lost"
        which = f", the last is sweep {last.last}" if last.last >= last.first else ""
        return f"its log was damaged, {lost}{which}: {last.reason}"

    def close(self) -> None:
        """Close the file."""
        in_place = self._files_at_path() == self._identities
        with contextlib.suppress(*SQLITE_ERRORS):
            self._db.close()
        with contextlib.suppress(OSError):
            if in_place:
                self._head_file.note(self._newest(closed=True))
        self._head_file.close()

    def abandon(self) -> None:
        """Let the file go as it is, without a word that it is whole."""
        self._let_go()

    def commit(self, arrivals: Sequence[Arrival], now: Instant, retention: Retention) -> list[Committed]:
        """Append ``arrivals`` in one transaction that is on the disk on return, and remove what retention says.

        What is written into a file that has no name any more is lost with this process: that raises LogError too.
        """
        self._check_in_place()
        log = replace(self._log, elapsed=self._log.elapsed.at(now))
        committed = []
        try:
            self._head_file.reserve(log.log_id, log.head + len(arrivals))
            with self._db:
                self._db.execute("BEGIN IMMEDIATE")
                for arrival in arrivals:
                    result = self._known(log, arrival)
                    if result is None:
                        log, result = self._append(log, arrival, now.utc_s)
                    committed.append(result)
                log = self._trim(log, retention)
                self._db.execute(_UPDATE, log.row())
            self._log = log
            self._head_file.note(self._newest(closed=False))
        except SQLITE_ERRORS as error:
            raise log_error(self._path, "written", error) from error
        except OSError as error:
            raise self._os_error("written", error) from error
        self._check_in_place()  # once more: it may have gone meanwhile
        return committed

    # ---- Opening --------------------------------------------------------------------------------------------------

    def _prepare(self, now: Instant) -> None:
        self._db.execute("PRAGMA cell_size_check = ON")
        if log_schema.is_new(self._db):
            self._create(now)
        version = log_schema.version_of(self._db, self._path)
        if version != log_schema.VERSION:
            earlier = f"it is of an earlier gateway (schema {version})" if version else "its tables are not a log's"
            raise damaged(self._path, earlier)
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        self._log = read_log(self._db, self._path)
        self._gaps = read_gaps(self._db, self._path)
        self._check_newest()
        self._agree_with_head_file(now)
        self._identities = self._files_at_path()

    def _refuse_lost(self) -> None:
        """Make no new log where there was one. SQLite would, and delete its -wal."""
        heads = head_file.read(head_path(self._path))
        size_bytes = _size_bytes(self._path)
        held = size_bytes or heads.newest or heads.reserved or _size_bytes(self._written[1])
        if size_bytes < HEADER_BYTES and held:
            raise damaged(self._path, "the file is empty or gone, and it held a log")

    def _create(self, now: Instant) -> None:
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        with self._db:
            self._db.execute("BEGIN IMMEDIATE")
            log = Log(log_schema.new_log_id(), 0, 1, 0, NO_SWEEP, 0, Elapsed(0.0, "", 0.0).at(now))
            log_schema.create(self._db, log)

    def _check_newest(self) -> None:
        rows = self._db.execute(_NEWEST).fetchall()
        check_rows(self._path, self._log, rows)
        self._refuse_another_units(rows)
        last = rows[0][0] if rows else self.tail - 1
        if last > self.head or uncovered(self._gaps, last + 1, self.head):
            raise damaged(self._path, f"its last sweep is {last} and should be {self.head}")
        if rows and newest_differs(self._log, rows[0], self._gaps):
            raise damaged(self._path, f"sweep {last} is not the one that was logged last")

    def _refuse_another_units(self, rows: Sequence[SweepRow]) -> None:
        """The checksums of a file that was put in another unit's place are sound."""
        unit = self._path.stem
        if rows and (found := Sweep.FromString(rows[0][7]).unit) != unit:
            raise LogError(
                f"log {self._path} holds sweeps of unit {found!r}: stop the gateway and put all files of unit {unit!r} "
                f"back, or begin a new log: noctule-gateway repair {self._path.parent} --unit {unit}"
            )

    def _agree_with_head_file(self, now: Instant) -> None:
        """Go on above every sequence that may have been used."""
        self._file = head_file.file_identity(self._path)
        heads, log = head_file.read(head_path(self._path), self._file), self._log
        if not log.adopted and not heads.copied and (heads.newest is None or heads.newest.log_id != log.log_id):
            self._head_file.begin(self._newest(closed=False), reserved=0)
            self._note_adopted(log)
            return
        most_used = heads.most_used(log.log_id, now.kernel_boot)
        if most_used is None:
            raise damaged(self._path, "its head file does not know it (the log was copied here, or that is damaged)")
        newest = heads.newest if heads.newest is not None and heads.newest.log_id == log.log_id else None
        if newest is not None and newest.head == log.head and newest.newest != log.newest.hex():
            raise damaged(self._path, f"its head file knows another sweep {log.head}: the log was copied here")
        lost_to = log.head if newest is None else max(newest.head, log.head)
        sure = newest is not None and (newest.closed or newest.kernel_boot == now.kernel_boot)
        if lost_to > log.head:
            self._go_on_after(Gap(log.head + 1, lost_to, True, log.elapsed.seconds, "its newest commits are gone"))
            sure = False
        if not sure and most_used > self.head:
            unused = Gap(self.head + 1, most_used, False, log.elapsed.seconds, "not used, or lost with the power")
            self._go_on_after(unused)
        self._head_file.begin(self._newest(closed=False), reserved=self.head)
        self._note_adopted(self._log)

    def _note_adopted(self, log: Log) -> None:
        if not log.adopted:
            self._log = replace(log, adopted=1)
            self._db.execute(_UPDATE, self._log.row())

    def _go_on_after(self, gap: Gap) -> None:
        """Use no sequence of ``gap`` any more."""
        log = replace(self._log, head=gap.last)
        with self._db:
            self._db.execute("BEGIN IMMEDIATE")
            self._db.execute("INSERT INTO gaps VALUES (?, ?, ?, ?, ?, ?)", gap.row())
            self._db.execute(_UPDATE, log.row())
        self._log = log
        self._gaps.append(gap)

    def _newest(self, closed: bool) -> Newest:
        log = self._log
        return Newest(log.log_id, log.head, log.newest.hex(), log.elapsed.kernel_boot, closed, self._file)

    # ---- In one transaction ---------------------------------------------------------------------------------------

    def _known(self, log: Log, arrival: Arrival) -> Committed | None:
        identity = (arrival.sweep.boot, arrival.sweep.sequence, arrival.digest)
        for (log_sequence,) in self._db.execute(_KNOWN, identity).fetchall():
            rows = self._db.execute(_AT, (log_sequence,)).fetchall()
            check_rows(self._path, log, rows)
            if not rows or rows[0][1:4] != identity:
                raise damaged(self._path, f"its index names sweep {log_sequence} for another")
            return Committed(log_sequence, rows[0][7], fresh=False)
        return None

    def _append(self, log: Log, arrival: Arrival, utc_s: float) -> tuple[Log, Committed]:
        sweep = Sweep()
        sweep.CopyFrom(arrival.sweep)
        sweep.log_id, sweep.log_sequence = log.log_id, log.head + 1
        record = sweep.SerializeToString()
        place = (sweep.log_sequence, sweep.boot, sweep.sequence, arrival.digest, arrival.start_tick)
        row: SweepRow = sealed(log.log_id, (*place, float(utc_s), float(log.elapsed.seconds), record, log.newest))
        self._db.execute("INSERT INTO sweeps VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", row)
        after = replace(log, head=sweep.log_sequence, size_bytes=log.size_bytes + len(record), newest=row[-1])
        return after, Committed(sweep.log_sequence, record, fresh=True)

    def _trim(self, log: Log, retention: Retention) -> Log:
        """Remove the oldest records that are too much or too old. A damaged row's age is not believed.

        The newest one stays: its acknowledgement may be lost, and the unit sends it again however late.
        """
        removed_bytes = 0
        last = 0
        (newest,) = self._db.execute("SELECT max(log_sequence) FROM sweeps").fetchone()
        rows = self._db.execute(_OLDEST)
        for row in rows:
            check_rows(self._path, log, [row])
            too_much = log.size_bytes - removed_bytes > retention.max_bytes
            too_old = log.elapsed.seconds - row[6] > retention.max_age_s
            if row[0] == newest or not (too_much or too_old):
                break
            last = row[0]
            removed_bytes += len(row[7])
        rows.close()
        if not last:
            return log
        self._db.execute("DELETE FROM sweeps WHERE log_sequence <= ?", (last,))
        return replace(log, tail=last + 1, size_bytes=log.size_bytes - removed_bytes)

    # ---- Its files ------------------------------------------------------------------------------------------------

    def _let_go(self) -> None:
        with contextlib.suppress(*SQLITE_ERRORS):
            self._db.close()
        self._head_file.close()

    def _files_at_path(self) -> list[tuple[int, int] | None]:
        """Which files bear the names of the database and its -wal now."""
        return [_identity(path) for path in self._written]

    def _check_in_place(self) -> None:
        if self._files_at_path() == self._identities:
            return
        # A file that was moved without its -wal is so made whole, and the -wal harms none that was put in its place.
        with contextlib.suppress(*SQLITE_ERRORS):
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        raise LogError(
            f"log {self._path} was moved, deleted or replaced under the running gateway: it opens the file again "
            "or begins a new log; stop the gateway before you touch its folder"
        )

    def _os_error(self, what: str, error: OSError) -> LogError:
        return LogError(
            f"log {self._path} can't be {what}: {error}; see that the folder is there and may be written to, "
            "and that its disk has room"
        )


def _size_bytes(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino
