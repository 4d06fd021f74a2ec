"""The rows of a log and their checksums: over content and place, each sweep's over the one before it too.

A checksum is BLAKE2b with 16 bytes: it finds accidents, no forger. A sweep's row covers its log_id and log_sequence, so
that a row of another log or another place fails; it names the checksum of the row before it, so that a row that was
exchanged or has gone shows between its neighbours. Retention removes from the tail, and what is left stays a chain.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import Any

from noctule.checksum import checksum
from noctule.elapsed import Elapsed

COLUMNS = "log_sequence, boot, sequence, digest, start_tick, committed_s, committed_elapsed_s, record, previous"
ALL_COLUMNS = f"{COLUMNS}, checksum"
NO_SWEEP = bytes(16)  # what the first row of a log names as the one before it

_RECORD, _PREVIOUS, _CHECKSUM = 7, 8, 9

# log_sequence, boot, sequence, digest, start_tick, committed_s, committed_elapsed_s, record, previous, checksum
SweepRow = tuple[Any, ...]


def sealed(log_id: str, row: SweepRow) -> SweepRow:
    """A sweep's row (COLUMNS) with its checksum. Raises TypeError where the record is no bytes."""
    record: bytes = row[_RECORD]
    place = repr((log_id, *row[:_RECORD], row[_PREVIOUS], len(record))).encode()
    return (*row, hashlib.blake2b(place + record, digest_size=16).digest())


def fault(log_id: str, row: SweepRow) -> str:
    """Why the row (ALL_COLUMNS) can't be one of this log; empty if it can. SQLite may give any type in any column."""
    try:
        sound = sealed(log_id, row[:_CHECKSUM]) == row
    except TypeError:
        sound = False
    return "" if sound else "its checksum does not fit"


@dataclass(frozen=True)
class Log:
    """The row of the table log: sequences ``tail`` to ``head``, ``newest`` the checksum of the newest sweep.

    ``tail`` is head + 1 in an empty log; ``size_bytes`` are those of the records.
    """

    log_id: str
    head: int
    tail: int
    size_bytes: int
    newest: bytes
    adopted: int
    elapsed: Elapsed

    def row(self) -> tuple[Any, ...]:
        values = (self.log_id, self.head, self.tail, self.size_bytes, self.newest, self.adopted, *astuple(self.elapsed))
        return (*values, checksum(*values))


def log_of(rows: Sequence[tuple[Any, ...]]) -> Log | None:
    """The log from the rows of its table; None where that is not one sound row."""
    if len(rows) != 1 or checksum(*rows[0][:-1]) != rows[0][-1]:
        return None
    log_id, head, tail, size_bytes, newest, adopted, *elapsed, _ = rows[0]
    return Log(log_id, head, tail, size_bytes, newest, adopted, Elapsed(*elapsed))


@dataclass(frozen=True)
class Gap:
    """Sequences that hold no sweep and never will; an empty one (``last`` < ``first``) tells of the file only.

    ``damaged``: they held sweeps, which are lost. Otherwise they were never used, as far as is known.
    """

    first: int
    last: int
    damaged: bool
    found_elapsed_s: float
    reason: str

    def row(self) -> tuple[Any, ...]:
        values = (self.first, self.last, int(self.damaged), float(self.found_elapsed_s), self.reason)
        return (*values, checksum(*values))

    def sequences(self, first: int, last: int) -> int:
        """How many of the sequences from ``first`` to ``last`` lie in the gap."""
        return max(min(last, self.last) - max(first, self.first) + 1, 0)


def gap_of(row: tuple[Any, ...]) -> Gap | None:
    """The gap in a row of the table gaps; None where it is damaged."""
    if checksum(*row[:-1]) != row[-1]:
        return None
    first, last, damaged, found_elapsed_s, reason = row[:5]
    return Gap(first, last, bool(damaged), found_elapsed_s, reason)
