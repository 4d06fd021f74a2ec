"""The small file beside a log that knows which sequences may have been used, whatever becomes of its last commits.

A log_sequence must never stand for two sweeps of one log_id: readers pass over what they believe to have read. SQLite
drops the newest commits in silence when their -wal is damaged or cut, and then head alone would lead to old numbers. So
the file beside holds two lines:

1. ``reserved``: no sequence above it was ever used. It is on the disk (fdatasync) before a commit goes beyond it, and
   moves by a thousand, so that it costs one write to the disk in a thousand sweeps.
2. ``head``: the newest commit, with its checksum, the kernel's boot and the identity of the log's file. It is written
   after each commit and before anybody hears of that, without waiting for the disk: it outlives the gateway, and not
   always a power cut.

A log that ends before ``head`` has lost commits; one that was open when the power went may have. In both cases the next
sweep gets the number after ``reserved``, and the numbers between are a gap. Where the file does not know the log
(deleted, damaged, or the log came from a copy) nobody can say what was used: the log gets a new log_id. A copy has
another identity, where the file system has one. Beside a backup lies a file that says so, because a log of an earlier
gateway has no head file. A sync at each commit would save the gap after a power cut and double the cost of every
commit.
"""

import json
import os
import struct
from contextlib import suppress
from dataclasses import asdict, dataclass
from fcntl import ioctl
from pathlib import Path
from typing import Any

from noctule.checksum import checksum

_LINE_BYTES = 256  # each line is padded to this, so that it is written over in place, also on a full disk
_AHEAD = 1000
# FS_IOC_GETVERSION of linux/fs.h: _IOR('v', 1, long). With it the number of an inode that was used before is another.
_GET_GENERATION = 0x80007601 | struct.calcsize("l") << 16
_COPY = b"This log is a copy, made by noctule-gateway backup: the gateway gives it a new log_id.\n"


@dataclass(frozen=True)
class Newest:
    """The newest commit. ``closed``: it was on the disk, whole, when the gateway ended."""

    log_id: str
    head: int
    newest: str  # hexadecimal
    kernel_boot: str
    closed: bool
    file: str = ""  # file_identity() of the log; empty where there is none


@dataclass(frozen=True)
class Reserved:
    """No sequence above ``reserved`` was used."""

    log_id: str
    reserved: int


@dataclass(frozen=True)
class Heads:
    """What the file says; None for a line that is missing or damaged. ``copied``: the log is a copy of another."""

    reserved: Reserved | None
    newest: Newest | None
    copied: bool

    def most_used(self, log_id: str, kernel_boot: str) -> int | None:
        """No sequence of this log above this was used; None where that is not known."""
        newest = self.newest
        if self.copied:
            return None
        if newest is not None and newest.log_id == log_id and (newest.closed or newest.kernel_boot == kernel_boot):
            return newest.head
        if self.reserved is not None and self.reserved.log_id == log_id:
            return self.reserved.reserved
        return None


def read(path: Path, file: str = "") -> Heads:
    """What the file at ``path`` says of a log with the identity ``file``, or of one that is not looked at.

    Raises OSError, but not if the file is missing.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        text = b""
    newest: Newest | None = _line(Newest, text[_LINE_BYTES : 2 * _LINE_BYTES])
    is_another = newest is not None and newest.file != file and bool(newest.file and file)
    return Heads(_line(Reserved, text[:_LINE_BYTES]), newest, is_another or text == _COPY)


def file_identity(path: Path) -> str:
    """What no other file has, and no copy of this one: number and generation of its inode.

    Empty where the file is not there, and on file systems that have no generations: FAT gives files other numbers at
    each mount.
    """
    with suppress(OSError), path.open("rb") as file:
        generation = struct.unpack("l", ioctl(file, _GET_GENERATION, bytes(struct.calcsize("l"))))[0]
        return f"{os.fstat(file.fileno()).st_ino}.{generation}"
    return ""


def mark_copy(path: Path) -> None:
    """Make the head file at ``path``, of a log that is a copy. Raises OSError."""
    path.write_bytes(_COPY)


class HeadFile:
    """The head file of an open log. Every method raises OSError."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
        self._reserved = 0

    def begin(self, newest: Newest, reserved: int) -> None:
        """Know this log from now on; on the disk on return."""
        self._reserved = max(reserved, newest.head)
        self._write(0, Reserved(newest.log_id, self._reserved))
        self.note(newest)
        os.fsync(self._file)

    def reserve(self, log_id: str, head: int) -> None:
        """Let commits go up to ``head``; on the disk on return."""
        if head > self._reserved:
            self._write(0, Reserved(log_id, head + _AHEAD))
            os.fdatasync(self._file)
            self._reserved = head + _AHEAD

    def note(self, newest: Newest) -> None:
        """A commit was made."""
        self._write(1, newest)
        if newest.closed:
            os.fsync(self._file)

    def close(self) -> None:
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _write(self, line: int, content: Newest | Reserved) -> None:
        values = asdict(content)
        text = json.dumps(values | {"checksum": checksum(*values.values()).hex()}, separators=(",", ":"))
        os.pwrite(self._file, text.encode().ljust(_LINE_BYTES - 1) + b"\n", line * _LINE_BYTES)


def _line(kind: type[Any], text: bytes) -> Any:
    try:
        values = json.loads(text)
        found = values.pop("checksum")
        return kind(**values) if checksum(*values.values()).hex() == found else None
    except (ValueError, TypeError, KeyError, AttributeError):
        return None
