"""The file of the mapper's store: its tables, a checksum in every row, and what becomes of a damaged one.

The gateways' logs hold nearly all that a store does. So a damaged store is set aside whole, what is sound in it goes
into a fresh one without the cursors, and the logs are read again from their tails: a sweep that is held already changes
nothing. A row that is not sound is never mapped.
"""

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from noctule.checksum import checksum
from noctule.errors import NoctuleError
from noctule.sqlite_faults import SQLITE_ERRORS, is_damage
from noctule_mapper.window import SCHEMA as WINDOW_SCHEMA

VERSION = 3
_TABLES = ("sweep", "set_aside", "cursor", "contour")
_SCHEMA = f"""
{WINDOW_SCHEMA}
CREATE TABLE IF NOT EXISTS cursor (
    unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, checksum BLOB NOT NULL);
CREATE TABLE IF NOT EXISTS set_aside (
    log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_ns INTEGER NOT NULL,
    reason TEXT NOT NULL, record BLOB NOT NULL, checksum BLOB NOT NULL,
    PRIMARY KEY (log_id, log_sequence));
CREATE TABLE IF NOT EXISTS contour (version INTEGER NOT NULL, checksum BLOB NOT NULL);
"""
_SUFFIXES = ("-shm", "-wal", "")
_HEADER_BYTES = 100  # of SQLite: it takes a shorter file for an empty one


class StoreError(NoctuleError):
    """A store file that can't be used."""


def sealed(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """The row with its checksum."""
    return (*row, checksum(*row))


def opened(path: Path, now_s: int) -> tuple[sqlite3.Connection, str]:
    """The store at ``path``, every row of it sound, and what was damaged; a new one where there is none.

    ``now_s``: UTC in whole seconds. Raises StoreError where it is of another version, or can't be opened or rebuilt.
    """
    try:
        damage = fault(path)
        if damage:
            damage = _rebuild(path, damage, now_s)
        return _connected(path), damage
    except (*SQLITE_ERRORS, OSError) as error:
        raise StoreError(f"{path} can't be used as the mapper's store ({error}): see to its disk and folder") from error


def fault(path: Path) -> str:
    """What is damaged in the store at ``path``; empty if nothing. It changes nothing.

    Raises StoreError on another version, sqlite3.Error where the file is not the trouble.
    """
    if not path.exists() or path.stat().st_size == 0:
        return "" if not Path(f"{path}-wal").exists() else "its database is gone or empty"
    try:
        with closing(
            sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, isolation_level=None)
        ) as database:
            database.execute("BEGIN")  # all that is read is of one moment, also while a mapper writes
            return _fault(database, path)
    except SQLITE_ERRORS as error:
        if not is_damage(error):
            raise
        return str(error)


def _fault(database: sqlite3.Connection, path: Path) -> str:
    version = _version(database, path)
    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok" or version != VERSION:
        return "" if found == "ok" else found
    damaged = {table: sum(row is None for row in _rows(database, table)) for table in _TABLES}
    named = [f"{count} rows of its table {table} do not fit" for table, count in damaged.items() if count]
    contours = len(list(_rows(database, "contour")))
    return "; ".join(named or ([] if contours == 1 else ["its table contour is empty"]))


def held(path: Path) -> int:
    """How many sweeps the sound store at ``path`` holds. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
        return database.execute("SELECT count(*) FROM sweep").fetchone()[0]


def _connected(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute("PRAGMA synchronous = FULL")
    if _version(database, path) == 2:
        _convert(database)
    _create(database, 0)
    return database


def _create(database: sqlite3.Connection, contour_version: int) -> None:
    database.executescript(_SCHEMA)
    if database.execute("SELECT * FROM contour").fetchone() is None:
        database.execute("INSERT INTO contour VALUES (?, ?)", sealed((contour_version,)))
    database.execute(f"PRAGMA user_version = {VERSION}")


def _version(database: sqlite3.Connection, path: Path) -> int:
    """3 or 2, or 0 of a file whose first opening was cut off. Raises StoreError and sqlite3.Error."""
    (version,) = database.execute("PRAGMA user_version").fetchone()
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if version == VERSION or version == 2 or (version == 0 and not tables):
        return version
    if set(_TABLES) <= tables:
        raise sqlite3.DatabaseError(f"its format is {version}, and its tables are those of {VERSION}")
    raise StoreError(
        f"{path} has format {version}, this mapper reads {VERSION}: stop the mapper, move the whole folder "
        f"{path.parent} away and start the mapper again; it reads what the gateways' logs still hold"
    )


def _convert(database: sqlite3.Connection) -> None:
    """Give the rows of a store of version 2 their checksums."""
    with database:
        database.execute("BEGIN IMMEDIATE")
        for table in _TABLES:
            database.execute(f"ALTER TABLE {table} ADD COLUMN checksum BLOB NOT NULL DEFAULT x''")
            for rowid, *row, _ in database.execute(f"SELECT rowid, * FROM {table}").fetchall():
                database.execute(f"UPDATE {table} SET checksum = ? WHERE rowid = ?", (checksum(*row), rowid))
        database.execute(f"PRAGMA user_version = {VERSION}")


def _rows(database: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...] | None]:
    """The rows of a table, and None for each one that does not fit. Raises sqlite3.Error."""
    for row in database.execute(f"SELECT * FROM {table} NOT INDEXED"):
        yield row if checksum(*row[:-1]) == row[-1] else None


def _rebuild(path: Path, damage: str, now_s: int) -> str:
    """Set the store aside and put a fresh one in its place, with what is sound; what was done, for the operator."""
    new, folder = Path(f"{path}-new"), _folder(path)
    for suffix in ("", "-journal", "-wal", "-shm"):
        Path(f"{new}{suffix}").unlink(missing_ok=True)
    folder.mkdir(parents=True)
    for suffix in _SUFFIXES:  # a copy: until the fresh one is whole, the damaged one stays where it is
        if (file := Path(f"{path}{suffix}")).exists():
            shutil.copy2(file, folder / file.name)
    with closing(sqlite3.connect(new, isolation_level=None)) as target:
        taken = _copy(path, target, now_s)
    for suffix in _SUFFIXES[:-1]:
        Path(f"{path}{suffix}").unlink(missing_ok=True)
    new.replace(path)
    return (
        f"the mapper's store was damaged ({damage}): {taken} sound sweeps of it are kept, and the gateways' logs are "
        f"read again; the damaged one is in {folder}"
    )


def _folder(path: Path) -> Path:
    number = 1
    while (folder := path.parent / "set-aside" / f"{path.stem}.{number}").exists():
        number += 1
    return folder


def _copy(path: Path, target: sqlite3.Connection, now_s: int) -> int:
    """Copy the sound rows of all but the cursors; how many sweeps. No contour bears a number for a second time."""
    taken = 0
    version = now_s  # far above what any mapper has counted to
    target.executescript(_SCHEMA)
    with target:
        target.execute("BEGIN IMMEDIATE")
        for table in ("sweep", "set_aside", "contour"):
            for row in _sound(path, table):
                if table == "contour":
                    version = row[0]
                    continue
                marks = ", ".join("?" * len(row))
                added = target.execute(f"INSERT OR IGNORE INTO {table} VALUES ({marks})", row).rowcount
                taken += added if table == "sweep" else 0
        target.execute("INSERT INTO contour VALUES (?, ?)", sealed((version,)))
        target.execute(f"PRAGMA user_version = {VERSION}")
    return taken


def _sound(path: Path, table: str) -> Iterator[tuple[Any, ...]]:
    """The sound rows of a table of the damaged file, as far as they can be read."""
    if not path.exists() or path.stat().st_size < _HEADER_BYTES:
        return
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as source:
            yield from filter(None, _rows(source, table))
    except SQLITE_ERRORS:
        return
