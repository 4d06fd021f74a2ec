"""A data folder: its room, who may write it, and which program holds it."""

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from noctule import folder_lock
from noctule.doctor.finding import Finding, Level
from noctule.doctor.host import Host

LITTLE_BYTES, NONE_BYTES = 1 << 30, 64 << 20


@dataclass(frozen=True)
class Room:
    """What a file system has left."""

    bytes: int
    files: int


def room(folder: Path) -> Room:
    """The room on the file system of ``folder``. Raises OSError."""
    state = os.statvfs(folder)
    # Some file systems count no files, and say 0 of 0.
    return Room(state.f_bavail * state.f_frsize, state.f_favail if state.f_files else 1 << 30)


def check(folder: Path, left: Room, site: str | None, host: Host) -> Iterator[Finding]:
    """``site``: that of the site file, or None where none was given."""
    about = f"data folder {folder}"
    if not host.may_use(folder):
        text = f"this user may not write it: run as its owner, or sudo chown -R USER {folder}"
        yield Finding(Level.FAULT, about, text)
    if left.bytes < NONE_BYTES or left.files < 100:
        text = f"{_mib(left)} and {left.files} files are left: make room, nothing can be stored"
        yield Finding(Level.FAULT, about, text)
    elif left.bytes < LITTLE_BYTES:
        yield Finding(Level.WARNING, about, f"only {_mib(left)} are left: make room")
    else:
        yield Finding(Level.OK, about, f"{_mib(left)} are left")
    yield _owner(folder, about, site, host)


def _owner(folder: Path, about: str, site: str | None, host: Host) -> Finding:
    owner = folder_lock.owner_of(folder)
    if owner is None:
        return Finding(Level.OK, about, "no program has used it yet")
    if site is not None and owner.site not in ("", site):
        text = f"it holds the data of the {owner}, and the site file is of {site!r}: give the right folder"
        return Finding(Level.FAULT, about, text)
    pid = _lock_holder(folder / folder_lock.FILE_NAME, host)
    return Finding(Level.OK, about, f"of the {owner}, " + (f"in use (process {pid})" if pid else "not in use"))


def _lock_holder(file: Path, host: Host) -> int | None:
    """The process that holds the lock, by /proc/locks: to try the lock could keep a program that starts from it."""
    state = file.stat()
    place = f"{os.major(state.st_dev):02x}:{os.minor(state.st_dev):02x}:{state.st_ino}"
    try:
        rows = [line.split() for line in (host.proc / "locks").read_text().splitlines()]
    except OSError:
        return None
    return next((int(row[4]) for row in rows if len(row) > 5 and row[1] == "FLOCK" and row[5] == place), None)


def _mib(left: Room) -> str:
    return f"{left.bytes / 2**20:,.0f} MiB"
