"""What can still be read of a log's file that is damaged, or was written by an earlier gateway.

Rows are looked for from both ends, then one by one in between, so that an unreadable page hides only its own rows. Each
row is believed only with its checksum. Files of earlier gateways have none: their rows must agree with the record.
"""

import sqlite3
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import DecodeError

from noctule.elapsed import Elapsed
from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file
from noctule_gateway.log.log_files import head_path
from noctule_gateway.log.log_schema import VERSION, version_of
from noctule_gateway.log.rows import ALL_COLUMNS, Gap, Log, SweepRow, fault, gap_of, log_of

_EARLIER = {
    1: "log_sequence, boot, sequence, digest, start_tick, committed_s, 0.0, record, x'', x''",
    2: "log_sequence, boot, sequence, digest, start_tick, committed_s, committed_elapsed_s, record, x'', x''",
}
_MOST_PROBES = 1_000_000  # sequences asked for one by one
_MOST_SEQUENCE = 2**53


@dataclass(frozen=True)
class Found:
    """A sweep's row (COLUMNS), or why there is none at this log_sequence."""

    log_sequence: int
    row: SweepRow | None
    reason: str


class Salvage:
    """An opened file of a log, read only. ``log_id`` is empty where nothing says it; ``log`` None where not sound."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._db = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, isolation_level=None)
        self._db.execute("BEGIN")  # all that is read is of one moment, also while a gateway writes
        self.version, self.strange = self._version()
        self.log = self._log()
        self.gaps = self._gaps() if self.version == VERSION else []
        self.log_id = self.log.log_id if self.log else self._log_id()

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def sweeps(self) -> Iterator[Found]:
        """What is at each sequence that the file names, in their order. A row waits for the next to attest to it."""
        held: SweepRow | None = None
        for log_sequence in self._sequences():
            found = self._at(log_sequence)
            if held is not None:
                yield self._attested(held, found.row)
            held = found.row
            if held is None:
                yield found
        if held is not None:
            newest = self.log.newest if self.log and self.log.head == held[0] and self.version == VERSION else None
            sound = newest is None or held[9] == newest
            yield Found(held[0], held if sound else None, "" if sound else "it is not the one that was logged last")

    def _attested(self, row: SweepRow, following: SweepRow | None) -> Found:
        """Two rows that are both sound by themselves: the later one names what was before it."""
        if self.version == VERSION and following is not None and following[0] == row[0] + 1 and following[8] != row[9]:
            return Found(row[0], None, "it is not the one that was followed by the next")
        return Found(row[0], row, "")

    def _at(self, log_sequence: int) -> Found:
        columns = _EARLIER.get(self.version, ALL_COLUMNS)
        try:
            rows = self._db.execute(
                f"SELECT {columns} FROM sweeps NOT INDEXED WHERE log_sequence = ?", (log_sequence,)
            ).fetchall()
        except SQLITE_ERRORS as error:
            return Found(log_sequence, None, str(error))
        if not rows:
            return Found(log_sequence, None, "it is missing")
        reason = fault(self.log_id, rows[0]) if self.version == VERSION else _unlike_record(self.log_id, rows[0])
        return Found(log_sequence, None if reason else rows[0], reason)

    def _sequences(self) -> list[int]:
        """The sequences that the file may hold, in their order."""
        upwards, whole = self._scan("ASC")
        if whole:
            found = upwards
        else:
            downwards, _ = self._scan("DESC")
            low, high = max(upwards, default=0), min(downwards, default=(self.log.head if self.log else 0) + 1)
            between = range(low + 1, high) if high - low <= _MOST_PROBES else range(0)
            found = upwards | downwards | set(between)
        return sorted(sequence for sequence in found if 0 < sequence < _MOST_SEQUENCE)

    def _scan(self, order: str) -> tuple[set[int], bool]:
        """The sequences as far as they can be read, and whether that is all."""
        found: set[int] = set()
        try:
            for (log_sequence,) in self._db.execute(
                f"SELECT log_sequence FROM sweeps NOT INDEXED ORDER BY log_sequence {order}"
            ):
                found.add(log_sequence)
        except SQLITE_ERRORS:
            return found, False
        return found, True

    def integrity(self) -> str:
        """What SQLite finds wrong with its own structure; empty if nothing."""
        try:
            (found,) = self._db.execute("PRAGMA integrity_check(1)").fetchone()
        except SQLITE_ERRORS as error:
            return str(error)
        return "" if found == "ok" else found

    def _version(self) -> tuple[int, bool]:
        """The version to read by, and whether the tables are strange: then their rows fail their checksums."""
        try:
            version = version_of(self._db, self._path)
        except SQLITE_ERRORS:
            return VERSION, True
        except LogError:
            self.close()
            raise
        return version or VERSION, not version

    def _log(self) -> Log | None:
        try:
            rows = self._db.execute("SELECT * FROM log LIMIT 2").fetchall()
            if self.version == VERSION:
                return log_of(rows)
            (log_id, head, size_bytes, *elapsed), *more = rows
            (tail,) = self._db.execute("SELECT min(log_sequence) FROM sweeps").fetchone()
        except (*SQLITE_ERRORS, ValueError):
            return None
        sound = not more and isinstance(log_id, str) and isinstance(head, int) and log_id and head >= 0
        counted = Elapsed(*elapsed) if elapsed else Elapsed(0.0, "", 0.0)
        return Log(log_id, head, tail or head + 1, size_bytes, b"", 0, counted) if sound else None

    def _gaps(self) -> list[Gap]:
        try:
            found = [gap_of(row) for row in self._db.execute("SELECT * FROM gaps ORDER BY first, last")]
        except SQLITE_ERRORS:
            return []
        return [gap for gap in found if gap is not None]

    def _log_id(self) -> str:
        """As the head file says, else the first record that can be read."""
        heads = head_file.read(head_path(self._path))
        for line in (heads.newest, heads.reserved):
            if line is not None:
                return line.log_id
        try:
            for (record,) in self._db.execute("SELECT record FROM sweeps NOT INDEXED ORDER BY log_sequence"):
                if (sweep := _sweep(record)) is not None and sweep.log_id:
                    return sweep.log_id
        except SQLITE_ERRORS:
            pass
        return ""


def _unlike_record(log_id: str, row: SweepRow) -> str:
    sweep = _sweep(row[7])
    if sweep is None:
        return "its record can't be read"
    place = (sweep.log_id, sweep.log_sequence, sweep.boot, sweep.sequence)
    numbers = isinstance(row[4], int) and isinstance(row[5], float) and isinstance(row[6], float)
    sound = place == (log_id, *row[:3]) and numbers and isinstance(row[3], bytes)
    return "" if sound else "its record is of another place"


def _sweep(record: object) -> Sweep | None:
    try:
        return Sweep.FromString(record) if isinstance(record, bytes) else None
    except DecodeError:
        return None
