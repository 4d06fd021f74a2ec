"""Reads a log's records, each of them checked: what does not fit is never handed out.

log_sequence runs from tail to head, but for the gaps that the log states; the oldest records are removed by retention.
"""

import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.log.faults import damaged, log_error
from noctule_gateway.log.rows import ALL_COLUMNS, Gap, Log, SweepRow, fault, gap_of, log_of

_FROM = f"SELECT {ALL_COLUMNS} FROM sweeps NOT INDEXED WHERE log_sequence >= ? ORDER BY log_sequence LIMIT ?"
_BEFORE = "SELECT log_sequence, checksum FROM sweeps WHERE log_sequence < ? ORDER BY log_sequence DESC LIMIT 1"
_OF_BOOT = "SELECT log_sequence FROM sweeps WHERE boot = ? ORDER BY log_sequence DESC LIMIT 1"


@dataclass(frozen=True)
class LogSlice:
    """Records in the order of log_sequence, and the bounds of the log at that moment; tail is head + 1 when empty.

    ``gaps`` are those among the sequences that the slice covers.
    """

    log_id: str
    head: int
    tail: int
    records: tuple[bytes, ...]
    gaps: tuple[Gap, ...] = ()


class LogReader:
    """A log that another LogFile writes. For one thread at a time.

    Every method raises LogError, and DamagedError where what it reads does not fit.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        try:
            self._db = sqlite3.connect(
                f"{path.absolute().as_uri()}?mode=rw", uri=True, isolation_level=None, check_same_thread=False
            )
        except SQLITE_ERRORS as error:
            raise log_error(path, "opened", error) from error

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def read(self, first: int, max_records: int, max_bytes: int, last: int) -> LogSlice:
        """Records of log_sequence ``first`` to ``last``; at least one, where there is one, whatever ``max_bytes``."""
        try:
            with self._db:
                self._db.execute("BEGIN")
                log = read_log(self._db, self._path)
                head = min(log.head, last)
                before = self._db.execute(_BEFORE, (first,)).fetchone()
                rows, all_read = self._rows(first, max_records, max_bytes, head)
                gaps = read_gaps(self._db, self._path)
        except SQLITE_ERRORS as error:
            raise log_error(self._path, "read", error) from error
        to = head if all_read else rows[-1][0] if rows else first - 1
        check_rows(self._path, log, rows)
        self._check_whole(max(first, log.tail), to, rows, gaps)
        self._check_chain(log, before, rows, gaps)
        covered = tuple(gap for gap in gaps if gap.sequences(first, to))
        return LogSlice(log.log_id, head, log.tail, tuple(row[7] for row in rows), covered)

    def last_of_boot(self, boot: int) -> tuple[int, Sweep] | None:
        """Start tick and record of the newest sweep made under ``boot``, a boot_of_life; None if there is none."""
        try:
            with self._db:
                self._db.execute("BEGIN")
                log = read_log(self._db, self._path)
                found = self._db.execute(_OF_BOOT, (boot & 0xFFFF,)).fetchone()
                rows = self._db.execute(_FROM, (found[0], 1)).fetchall() if found else []
        except SQLITE_ERRORS as error:
            raise log_error(self._path, "read", error) from error
        if not rows:
            return None
        check_rows(self._path, log, rows)
        sweep = Sweep.FromString(rows[0][7])
        return (rows[0][4], sweep) if sweep.life == boot >> 16 else None

    def _rows(self, first: int, max_records: int, max_bytes: int, head: int) -> tuple[list[SweepRow], bool]:
        """Rows within the bounds, and whether there are no more up to ``head``."""
        rows: list[SweepRow] = []
        size_bytes = 0
        for row in self._db.execute(_FROM, (first, max_records + 1)):
            if row[0] > head:
                break
            size_bytes += len(row[7]) if isinstance(row[7], bytes) else 0
            if len(rows) == max_records or (rows and size_bytes > max_bytes):
                return rows, False
            rows.append(row)
        return rows, True

    def _check_whole(self, first: int, last: int, rows: Sequence[SweepRow], gaps: Iterable[Gap]) -> None:
        """Every sequence from ``first`` to ``last`` is in a row or in a gap."""
        missing = uncovered(gaps, first, last) - len(rows)
        if missing > 0:
            raise damaged(self._path, f"{missing} of the sweeps {first} to {last} are missing")

    def _check_chain(
        self, log: Log, before: tuple[int, bytes] | None, rows: Sequence[SweepRow], gaps: Sequence[Gap]
    ) -> None:
        """Each row names the one before it, and the log its newest."""
        links = [before, *((row[0], row[9]) for row in rows)] if before else [(row[0], row[9]) for row in rows]
        named = [row[8] for row in (rows if before else rows[1:])]
        for link, previous in zip(links, named, strict=False):
            if link[1] != previous:
                raise damaged(self._path, f"sweep {link[0]} is not the one that was followed by the next")
        if rows and newest_differs(log, rows[-1], gaps):
            raise damaged(self._path, f"sweep {log.head} is not the one that was logged last")


def newest_differs(log: Log, row: SweepRow, gaps: Iterable[Gap]) -> bool:
    """Whether the row is the newest of the log, and not the one that the log knows as its newest."""
    return uncovered(gaps, row[0] + 1, log.head) == 0 and row[9] != log.newest


def uncovered(gaps: Iterable[Gap], first: int, last: int) -> int:
    """How many of the sequences from ``first`` to ``last`` lie in no gap."""
    return max(last - first + 1, 0) - sum(gap.sequences(first, last) for gap in gaps)


def read_log(db: sqlite3.Connection, path: Path) -> Log:
    """The row of the table log. Raises sqlite3.Error and DamagedError."""
    log = log_of(db.execute("SELECT * FROM log LIMIT 2").fetchall())
    if log is None:
        raise damaged(path, "its table log does not fit")
    return log


def read_gaps(db: sqlite3.Connection, path: Path) -> list[Gap]:
    """The log's gaps in their order. Raises sqlite3.Error and DamagedError."""
    gaps = [gap_of(row) for row in db.execute("SELECT * FROM gaps ORDER BY first, last")]
    sound = [gap for gap in gaps if gap is not None]
    if len(sound) < len(gaps):
        raise damaged(path, "its table gaps does not fit")
    return sound


def check_rows(path: Path, log: Log, rows: Iterable[SweepRow]) -> None:
    """Raise DamagedError at the first row that does not fit."""
    for row in rows:
        if reason := fault(log.log_id, row):
            raise damaged(path, f"sweep {row[0]}: {reason}")
