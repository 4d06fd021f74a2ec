"""Units' logs by hand, while no gateway runs: a damaged one is set aside whole, and the gateway begins a new one.

A log is three files: the newest commits may be in its -wal alone. So nobody should move one of them by hand.
"""

import sqlite3
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from noctule.folder_lock import FolderLock, Owner, owner_of
from noctule.sqlite_faults import SQLITE_ERRORS
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_files import SUFFIX, set_aside, set_aside_folder
from noctule_gateway.log.look import look_at, units_in


@dataclass(frozen=True)
class Repair:
    """What was found of a unit's log, and where it is now. ``trouble`` is empty where its file is sound."""

    unit: str
    sweeps: int
    trouble: str
    set_aside: Path | None

    def __str__(self) -> str:
        found = f"{self.unit}: {self.sweeps} readable sweeps; {self.trouble or 'the file is sound'}; "
        if self.set_aside is None:
            return found + "left as it is"
        return found + f"set aside in {self.set_aside}: the gateway begins a new log"


def repair(data: Path, units: list[str]) -> list[Repair]:
    """Set aside the logs of ``units``, sound or not; without ``units``, those of ``data`` whose file is damaged.

    Raises FolderError while a gateway holds the folder, LogError: no such log, no log at all, or its files can't be
    moved.
    """
    owner = owner_of(data)
    if not data.is_dir() or (owner is not None and owner.role != "gateway"):
        raise LogError(f"{data} is no gateway's data folder: give what noctule-gateway run has as --data")
    if not units and not units_in(data):  # before the lock, whose file would stay in a folder that is no gateway's
        raise LogError(f"{data} holds no logs: give what noctule-gateway run has as --data")
    with FolderLock(data, Owner("gateway", owner.site if owner else "", "repair")):
        known = units_in(data)
        for unit in units:
            if unit not in known:
                raise LogError(f"{data} holds no log of unit {unit!r}: it holds {', '.join(known) or 'none'}")
        try:
            return [_repair(data / f"{unit}{SUFFIX}", asked=unit in units) for unit in units or known]
        except OSError as error:
            raise LogError(f"a log in {data} can't be set aside: {error}") from error


def _repair(path: Path, asked: bool) -> Repair:
    found = look_at(path)
    folder = None
    if found.trouble or asked:
        if not found.trouble:
            _checkpoint(path)
        folder = set_aside_folder(path)
        set_aside(path, folder)
    return Repair(path.stem, found.sweeps, found.trouble, folder)


def _checkpoint(path: Path) -> None:
    """Bring the commits of the -wal into the database, so that one file holds all."""
    # Without room for that the -wal still holds them, and is set aside too.
    with suppress(*SQLITE_ERRORS), closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
