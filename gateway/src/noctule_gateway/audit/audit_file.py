"""One file of the audit log, as it is written: lines are only appended, each batch is on the disk before it counts."""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from noctule_gateway.audit import lines
from noctule_gateway.audit.lines import BEGINNING, Facts
from noctule_gateway.disk import sync


class AuditFile:
    """``number`` and ``hash`` are its last line's."""

    def __init__(self, path: Path, file: int, number: int, own_hash: str) -> None:
        self.path, self.number, self.hash = path, number, own_hash
        self._file = file
        self.size_bytes = 0

    def append(self, batch: Sequence[Facts]) -> None:
        """Append lines, for good. Raises OSError, after which the file is as before if the disk lets it."""
        number, own_hash, data = self.number, self.hash, b""
        for facts in batch:
            number += 1
            line, own_hash = lines.written({"number": number} | facts, own_hash)
            data += line
        try:
            _write_all(self._file, data)
            os.fsync(self._file)
        except OSError:
            os.ftruncate(self._file, self.size_bytes)
            raise
        self.number, self.hash, self.size_bytes = number, own_hash, self.size_bytes + len(data)

    def is_there(self) -> bool:
        """Whether the file still has its name in its folder."""
        try:
            return os.path.samestat(os.fstat(self._file), self.path.stat())
        except OSError:
            return False

    def close(self) -> None:
        """Write no more."""
        os.close(self._file)


def begin_file(folder: Path, family: str, whose: Facts, number: int, after: str) -> AuditFile:
    """A new file, the next of its ``family`` in ``folder``; it goes on from line ``number`` with the hash ``after``.

    Raises OSError.
    """
    present = lines.files(folder, family)
    path = folder / lines.file_name(present[-1][0] + 1 if present else 1, family)
    made = AuditFile(path, os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_EXCL, 0o640), number, after)
    try:
        made.append([{"event": "file begun", "audit": 1, "after": after} | whose])
        sync(folder)
    except OSError:
        made.close()
        path.unlink(missing_ok=True)
        raise
    return made


def last_line(folder: Path, family: str) -> tuple[int, str]:
    """Number and hash of the last whole line, as it says itself; zero where there is none.

    What was damaged before is for check() to say; the log goes on, and no number is used twice.
    """
    for _, path in reversed(lines.files(folder, family)):
        with suppress(OSError):
            for line in reversed(path.read_bytes().splitlines()):
                if (claimed := lines.claimed(line)) is not None:
                    return claimed
    return 0, BEGINNING


def _write_all(file: int, data: bytes) -> None:
    view = memoryview(data)
    while view:
        view = view[os.write(file, view) :]
