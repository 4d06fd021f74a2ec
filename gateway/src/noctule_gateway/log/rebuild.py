"""A damaged log, or one of an earlier gateway, is written into a fresh file from every row of it that is sound.

The rebuilt log keeps its log_id and all log_sequences where the head file knows how far these were used, and goes on
above them. Where nobody knows, it gets a new log_id, and readers read it again from its tail. What is lost is stated as
gaps, so that readers pass over it. The old files are set aside whole; only those of an earlier gateway whose every row
was taken over are not kept.
"""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path

from noctule.elapsed import Elapsed, Instant
from noctule.messages_pb2 import Sweep
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file, log_schema
from noctule_gateway.log.faults import log_error
from noctule_gateway.log.log_files import HEADER_BYTES, SET_ASIDE, head_path, new_path, set_aside_folder
from noctule_gateway.log.log_files import replace as replace_files
from noctule_gateway.log.rows import NO_SWEEP, Gap, Log, SweepRow, sealed
from noctule_gateway.log.salvage import Found, Salvage


def rebuild(path: Path, reason: str, now: Instant) -> str:
    """Rebuild the log at ``path``, which nobody has open; what was done, for the operator. Raises LogError."""
    folder = set_aside_folder(path)
    aside = f"the old files are in {SET_ASIDE}/{folder.name}"
    try:
        new = new_path(path)
        source = _opened(path)
        try:
            with closing(sqlite3.connect(new, isolation_level=None)) as target:
                log, taken, lost = _Copy(path, source, target, now, reason, aside).run()
            converted = source is not None and source.version < log_schema.VERSION and not lost
        finally:
            if source is not None:
                source.close()
        replace_files(path, folder)
        if converted:
            shutil.rmtree(folder)
            with suppress(OSError):  # others are there
                folder.parent.rmdir()
            return f"log {path} was converted from an earlier gateway's, with its {taken} sweeps, as log {log.log_id}"
    except SQLITE_ERRORS as error:
        raise LogError(f"{log_error(path, 'opened', error)} (it is to be rebuilt, since {reason})") from error
    except OSError as error:
        raise LogError(f"log {path} can't be opened: {error}; make room on the disk (it is to be rebuilt)") from error
    return f"log {path} was rebuilt as log {log.log_id} with {taken} sweeps, {lost} are lost: {reason}; {aside}"


def _opened(path: Path) -> Salvage | None:
    """None where nothing can be read of the file."""
    if not path.exists() or path.stat().st_size < HEADER_BYTES:
        return None  # SQLite would make it a database, and delete a -wal that lies beside
    try:
        return Salvage(path)
    except SQLITE_ERRORS:
        return None


class _Copy:
    """One pass over the source."""

    def __init__(
        self, path: Path, source: Salvage | None, target: sqlite3.Connection, now: Instant, reason: str, aside: str
    ):
        self._source, self._target, self._reason, self._aside = source, target, reason, aside
        self._gaps = list(source.gaps) if source else []
        self._new_gaps: list[Gap] = []
        known = source.log if source else None
        elapsed = known.elapsed if known else Elapsed(0.0, "", 0.0)
        heads = head_file.read(head_path(path), head_file.file_identity(path))
        of_heads = heads.newest.log_id if heads.newest else ""  # all that is known where nothing can be read
        self._old_id = source.log_id if source else of_heads
        self._earlier = source is not None and source.version < log_schema.VERSION
        self._newest_head = heads.newest.head if heads.newest and heads.newest.log_id == self._old_id else 0
        self._most_used = heads.most_used(self._old_id, now.kernel_boot) if self._old_id else None
        # These had no head file, and their log is taken at its word.
        if self._earlier and known is not None and not heads.copied:
            self._most_used = known.head
        log_id = log_schema.new_log_id() if self._most_used is None else self._old_id
        self._head = known.head if known else 0
        self._tail = known.tail if known else 0  # 0: nobody knows
        self._log = Log(log_id, 0, 0, 0, NO_SWEEP, 0, elapsed.at(now))
        self._taken = self._lost = 0

    def run(self) -> tuple[Log, int, int]:
        """The log, how many sweeps it holds, and how many are lost."""
        self._target.execute("PRAGMA synchronous = FULL")
        with self._target:
            self._target.execute("BEGIN IMMEDIATE")
            log_schema.create(self._target, self._log)
            last = self._copy()
            self._state_gaps(last)
            self._target.execute("DELETE FROM log")
            self._target.execute("INSERT INTO log VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", self._log.row())
        return self._log, self._taken, self._lost

    def _copy(self) -> int:
        """Copy the sound rows; the last sequence that was seen."""
        before = self._tail - 1
        for found in self._found():
            if before >= 0 and found.log_sequence > before + 1:
                self._gap(before + 1, found.log_sequence - 1, "they are missing")
            self._tail = self._tail or found.log_sequence
            before = max(before, found.log_sequence)
            if found.row is None:
                self._gap(found.log_sequence, found.log_sequence, found.reason)
            else:
                self._insert(found.row)
        return max(before, 0)

    def _found(self) -> Iterator[Found]:
        """What the source holds, without the rows far beyond any sequence that may have been used: they lie."""
        most = max(self._most_used or 0, self._head)
        for found in self._source.sweeps() if self._source else ():
            if found.row is not None or found.log_sequence <= most:
                yield found

    def _insert(self, row: SweepRow) -> None:
        record = row[7]
        if self._log.log_id != self._old_id:
            sweep = Sweep.FromString(record)
            sweep.log_id = self._log.log_id
            record = sweep.SerializeToString()
        new = sealed(self._log.log_id, (*row[:7], record, self._log.newest))
        self._target.execute("INSERT INTO sweeps VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", new)
        size_bytes = self._log.size_bytes + len(record)
        self._log = replace(self._log, head=new[0], size_bytes=size_bytes, newest=new[-1])
        self._taken += 1

    def _state_gaps(self, last: int) -> None:
        """State what is lost behind the last row too, and go on above all that may have been used."""
        held_to = max(last, self._newest_head, self._head, *(gap.last for gap in self._gaps))
        if held_to > last:
            self._gap(last + 1, held_to, "they are missing")
        if self._most_used is not None and self._most_used > held_to and not self._earlier:
            self._add(
                Gap(held_to + 1, self._most_used, False, self._log.elapsed.seconds, "not used, as far as is known")
            )
        if not self._lost and not self._earlier:
            self._new_gaps.append(Gap(1, 0, True, self._log.elapsed.seconds, f"{self._reason}; {self._aside}"))
        head = max(held_to, self._most_used or 0)
        self._log = replace(self._log, head=head, tail=self._tail or 1)
        for gap in sorted([*self._gaps, *self._new_gaps], key=lambda each: (each.first, each.last)):
            self._target.execute("INSERT INTO gaps VALUES (?, ?, ?, ?, ?, ?)", gap.row())

    def _gap(self, first: int, last: int, reason: str) -> None:
        """The sequences from ``first`` to ``last`` are lost, but for those that known gaps hold."""
        for known in self._gaps:
            if known.sequences(first, last):
                self._gap(first, known.first - 1, reason)
                self._gap(known.last + 1, last, reason)
                return
        if first > last:
            return
        self._lost += last - first + 1
        self._add(Gap(first, last, True, self._log.elapsed.seconds, f"{reason}; {self._aside}"))

    def _add(self, gap: Gap) -> None:
        """Neighbours of one reason are one gap."""
        before = self._new_gaps[-1] if self._new_gaps else None
        if before and (before.last, before.damaged, before.reason) == (gap.first - 1, gap.damaged, gap.reason):
            self._new_gaps[-1] = replace(before, last=gap.last)
        else:
            self._new_gaps.append(gap)
