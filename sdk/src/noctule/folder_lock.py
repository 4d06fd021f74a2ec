"""One owner for a data folder: a second program on it is refused, and so is one of another site or role.

The lock is the kernel's (flock) on a file in the folder, so it ends with its holder, however that ends. The file says
who holds the folder, and after that whose data it is. It stays there: a file that is removed could be locked twice.
"""

import fcntl
import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

from noctule.errors import NoctuleError

FILE_NAME = "owner.json"

_MOST_BYTES = 4096


class FolderError(NoctuleError):
    """A data folder that can't be used: another program holds it, or it holds other data."""


@dataclass(frozen=True)
class Owner:
    """Who works on a folder: ``role`` is "gateway" or "mapper", ``site`` empty where it is not known."""

    role: str
    site: str
    name: str

    def __str__(self) -> str:
        return f"{self.role} {self.name!r} of site {self.site!r}"


class FolderLock:
    """Holds ``folder`` from its making until close(), as a context manager too. Makes the folder if it is not there.

    Raises FolderError: another process holds the folder, it belongs to another site or role, or it can't be written.
    """

    def __init__(self, folder: Path, owner: Owner) -> None:
        self._folder, self._owner = folder, owner
        self._file = _lock(folder, owner)

    def keep(self) -> None:
        """Take the lock again if its file was deleted or replaced; nothing while the folder is not there.

        To be called now and again: a second program could lock the new file. Raises FolderError if one did.
        """
        if self._folder.is_dir() and not _is_at(self._file, self._folder / FILE_NAME):
            self.close()
            self._file = _lock(self._folder, self._owner)

    def close(self) -> None:
        """Let the folder go. The file still says whose data it holds."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def owner_of(folder: Path) -> Owner | None:
    """Whose data the folder holds; None if nothing there says so."""
    try:
        return _read((folder / FILE_NAME).read_bytes())[0]
    except OSError:
        return None


def _lock(folder: Path, owner: Owner) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = os.open(folder / FILE_NAME, os.O_RDWR | os.O_CREAT, 0o644)
    except (FileExistsError, NotADirectoryError) as error:
        raise FolderError(f"{folder} is no folder: give the {owner.role} a folder for its data") from error
    except OSError as error:
        raise _unusable(folder, error) from error
    try:
        _take(file, folder, owner)
    except BaseException as error:
        os.close(file)
        if isinstance(error, OSError):
            raise _unusable(folder, error) from error
        raise
    return file


def _take(file: int, folder: Path, owner: Owner) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise FolderError(_held(folder, owner, *_read(os.pread(file, _MOST_BYTES, 0)))) from error
    before, _ = _read(os.pread(file, _MOST_BYTES, 0))
    if before is not None and (before.role != owner.role or before.site not in ("", owner.site)):
        raise FolderError(
            f"{folder} holds the data of a {before.role} of site {before.site!r}: "
            f"give this {owner.role} a folder of its own"
        )
    text = json.dumps(asdict(owner) | {"pid": os.getpid()}).encode() + b"\n"
    os.pwrite(file, text, 0)  # over what was there: that needs no room on a full disk
    os.truncate(file, len(text))
    if not _is_at(file, folder / FILE_NAME):
        raise FolderError(f"{folder} was deleted at this moment: start again")


def _held(folder: Path, owner: Owner, holder: Owner | None, pid: int | None) -> str:
    who = "another program" if holder is None else f"{holder}"
    process = "" if pid is None else f" (process {pid})"
    return f"{folder} is in use by {who}{process}: stop that, or give this {owner.role} a folder of its own"


def _read(text: bytes) -> tuple[Owner | None, int | None]:
    """Owner and process as the file tells them. A power cut can have left anything in it."""
    try:
        told = json.loads(text)
        return Owner(*(str(told[name]) for name in ("role", "site", "name"))), int(told["pid"])
    except (ValueError, TypeError, KeyError, RecursionError):
        return None, None


def _is_at(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except OSError:
        return False


def _unusable(folder: Path, error: OSError) -> FolderError:
    return FolderError(
        f"{folder} can't be used ({error.strerror}): see that its disk has room and that it can be written to"
    )
