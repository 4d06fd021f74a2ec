"""The files of one log, which belong together: set aside whole, and replaced by a rebuilt log.

A rebuilt log is written beside as ``-new``, and its name becomes ``-ready`` once it is whole on the disk: from then on
it takes the log's place, whatever stops the gateway between two steps.
"""

from pathlib import Path

from noctule_gateway.disk import sync

SUFFIX = ".sqlite"
FILE_SUFFIXES = ("", "-wal", "-shm", "-head")  # the newest commits are in the -wal alone
HEADER_BYTES = 100  # of SQLite: it takes a shorter file for an empty one
SET_ASIDE = "set-aside"

_NEW, _READY = "-new", "-ready"


def head_path(path: Path) -> Path:
    """The head file of the log at ``path``."""
    return Path(f"{path}-head")


def new_path(path: Path) -> Path:
    """Where a rebuilt log is written; nothing is there on return. Raises OSError."""
    new = Path(f"{path}{_NEW}")
    for suffix in ("", "-journal", "-wal", "-shm"):
        Path(f"{new}{suffix}").unlink(missing_ok=True)
    return new


def set_aside_folder(path: Path) -> Path:
    """A folder for the files of the log at ``path``: the last one while it lacks the database, else a new one."""
    number = 1
    while (folder := path.parent / SET_ASIDE / f"{path.stem}.{number}").exists() and (folder / path.name).exists():
        number += 1
    return folder


def set_aside(path: Path, folder: Path) -> None:
    """Move the log's files into ``folder``, the database last. Raises OSError."""
    folder.mkdir(parents=True, exist_ok=True)
    for suffix in reversed(FILE_SUFFIXES):
        file = Path(f"{path}{suffix}")
        if file.exists():
            file.rename(folder / file.name)
    sync(folder)
    sync(path.parent)


def replace(path: Path, folder: Path) -> None:
    """Set the log's files aside in ``folder`` and put the one at new_path() in their place. Raises OSError."""
    new = Path(f"{path}{_NEW}")
    sync(new)
    new.rename(f"{path}{_READY}")
    sync(path.parent)
    set_aside(path, folder)
    Path(f"{path}{_READY}").rename(path)
    sync(path.parent)


def finish_replacing(path: Path) -> None:
    """Go on with a replacement that was cut off. Raises OSError."""
    ready = Path(f"{path}{_READY}")
    if ready.exists():
        set_aside(path, set_aside_folder(path))
        ready.rename(path)
        sync(path.parent)
