"""Units' logs by hand, while no gateway runs: a damaged one is set aside whole, and the gateway begins a new one.

A log is three files: the newest commits may be in its -wal alone. So nobody should move one of them by hand.
"""

import sqlite3
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import DecodeError

from noctule.folder_lock import FolderLock, Owner, owner_of
from noctule.messages_pb2 import Sweep
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_files import FILE_SUFFIXES
from noctule_gateway.log.log_schema import version_of

SET_ASIDE = "set-aside"
_SUFFIX = ".sqlite"


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

    Raises FolderError while a gateway holds the folder, LogError: no such log, or its files can't be moved.
    """
    owner = owner_of(data)
    if not data.is_dir() or (owner is not None and owner.role != "gateway"):
        raise LogError(f"{data} is no gateway's data folder: give what noctule-gateway run has as --data")
    with FolderLock(data, Owner("gateway", owner.site if owner else "", "repair")):
        known = sorted({path.name.partition(_SUFFIX)[0] for path in data.glob(f"*{_SUFFIX}*")})
        for unit in units:
            if unit not in known:
                raise LogError(f"{data} holds no log of unit {unit!r}: it holds {', '.join(known) or 'none'}")
        try:
            return [_repair(data / f"{unit}{_SUFFIX}", asked=unit in units) for unit in units or known]
        except OSError as error:
            raise LogError(f"a log in {data} can't be set aside: {error}") from error


def _repair(path: Path, asked: bool) -> Repair:
    sweeps, trouble = _look_at(path)
    folder = None
    if trouble or asked:
        if not trouble:
            _checkpoint(path)
        folder = _set_aside(path)
    return Repair(path.stem, sweeps, trouble, folder)


def _look_at(path: Path) -> tuple[int, str]:
    """How many sweeps can be read, and what is wrong with the file. Opened so that it and its -wal stay as they are."""
    sweeps = unreadable = 0
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as db:
            version_of(db, path)
            for (record,) in db.execute("SELECT record FROM sweeps ORDER BY log_sequence"):
                readable = _is_sweep(record)
                sweeps += readable
                unreadable += not readable
            (found,) = db.execute("PRAGMA integrity_check(1)").fetchone()
            (logs,) = db.execute("SELECT count(*) FROM log").fetchone()
    except sqlite3.Error as error:
        return sweeps, f"the file is damaged: {error}"
    if found != "ok":
        return sweeps, f"the file is damaged: {found}"
    if unreadable:
        return sweeps, f"the file is damaged: {unreadable} more records can't be read"
    return sweeps, "" if logs == 1 else "the file is damaged: its table log is empty"


def _is_sweep(record: object) -> bool:
    try:
        return isinstance(record, bytes) and bool(Sweep.FromString(record).log_sequence)
    except DecodeError:
        return False


def _checkpoint(path: Path) -> None:
    """Bring the commits of the -wal into the database, so that one file holds all."""
    # Without room for that the -wal still holds them, and is set aside too.
    with suppress(sqlite3.Error), closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _set_aside(path: Path) -> Path:
    """Move the log's files together into a folder that was not there before; the database last."""
    number = 1
    while (folder := path.parent / SET_ASIDE / f"{path.stem}.{number}").exists():
        number += 1
    folder.mkdir(parents=True)
    for suffix in reversed(FILE_SUFFIXES):
        file = Path(f"{path}{suffix}")
        if file.exists():
            file.rename(folder / file.name)
    return folder
