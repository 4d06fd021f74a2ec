"""The file of the mapper's store: its tables, a checksum in every row, a chain over the rows, and what becomes of a
damaged one.

The gateways' logs hold nearly all that a store does. So a damaged store is set aside whole, what is sound in it goes
into a fresh one without the cursors, and the logs are read again from their tails: a sweep that is held already changes
nothing. A row that is not sound is never mapped.
"""

import shutil
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import astuple
from functools import cache, reduce
from pathlib import Path
from typing import Any

from noctule.checksum import checksum
from noctule.elapsed import Elapsed, Instant
from noctule.errors import NoctuleError
from noctule.sqlite_faults import SQLITE_ERRORS, is_damage
from noctule_mapper.live import newest_commit
from noctule_mapper.live.newest_commit import Newest
from noctule_mapper.window import SCHEMA as WINDOW_SCHEMA

# SQLite's words for a commit that waits for the disk, and for one that leaves it to the system. A power cut can undo
# the newest of the latter, all from some moment on, so that cursors go back with the sweeps.
SYNCED, UNSYNCED = "FULL", "NORMAL"
VERSION = 5  # 4 had no chain, 3 checksums and no elapsed time, 2 none of these
_SCHEMA = (
    *WINDOW_SCHEMA,
    """CREATE TABLE IF NOT EXISTS cursor (
        unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, checksum BLOB NOT NULL)""",
    """CREATE TABLE IF NOT EXISTS set_aside (
        log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_elapsed_s REAL NOT NULL,
        reason TEXT NOT NULL, record BLOB NOT NULL, checksum BLOB NOT NULL,
        PRIMARY KEY (log_id, log_sequence))""",
    "CREATE TABLE IF NOT EXISTS contour (version INTEGER NOT NULL, checksum BLOB NOT NULL)",
    """CREATE TABLE IF NOT EXISTS elapsed (
        seconds REAL NOT NULL, kernel_boot TEXT NOT NULL, since_boot_s REAL NOT NULL, checksum BLOB NOT NULL)""",
    # Of each table whose rows come and go: how many there are, and the XOR of their checksums.
    """CREATE TABLE IF NOT EXISTS chain (
        of_table TEXT PRIMARY KEY, held INTEGER NOT NULL, xored BLOB NOT NULL, checksum BLOB NOT NULL)""",
)
_CHAINED = ("sweep", "set_aside", "cursor")
# They stand in the mapper's own connection and not in the file: every statement of it counts, and no other change does.
_TRIGGER = """
CREATE TEMP TRIGGER chain_{event}_{table} AFTER {event} ON main.{table} BEGIN
    UPDATE chain SET held = held + {change}, xored = xored(xored, {row}.checksum),
        checksum = checksum(of_table, held + {change}, xored(xored, {row}.checksum)) WHERE of_table = '{table}';
END
"""
_BEFORE_4 = (*_CHAINED, "contour")
_TABLES = {2: _BEFORE_4, 3: _BEFORE_4, 4: (*_BEFORE_4, "elapsed"), VERSION: (*_BEFORE_4, "elapsed", "chain")}
_OF_ONE_ROW = ("contour", "elapsed")
_NOTHING_COUNTED = Elapsed(0.0, "", 0.0)
_SUFFIXES = ("-shm", "-wal", "")
_HEADER_BYTES = 100  # of SQLite: it takes a shorter file for an empty one


class StoreError(NoctuleError):
    """A store file that can't be used."""


def sealed(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """The row with its checksum."""
    return (*row, checksum(*row))


def opened(path: Path, now: Instant) -> tuple[sqlite3.Connection, str]:
    """The store at ``path``, every row of it sound, and what was damaged; a new one where there is none.

    Raises StoreError where it is of another version, or can't be opened or rebuilt.
    """
    try:
        damage, newest = fault(path, now.kernel_boot), newest_commit.read(path)
        contours = newest.contours if newest else 0
        if damage:
            damage = _rebuild(path, damage, now, contours)
        return _connected(path, now, contours), damage
    except (*SQLITE_ERRORS, OSError) as error:
        raise StoreError(f"{path} can't be used as the mapper's store ({error}): see to its disk and folder") from error


def fault(path: Path, kernel_boot: str) -> str:
    """What is damaged in the store at ``path``; empty if nothing. It changes nothing. ``kernel_boot`` is the id of the
    present one.

    Raises StoreError on another version, sqlite3.Error where the file is not the trouble, OSError.
    """
    newest = newest_commit.read(path)  # first: a mapper may go on meanwhile
    if not path.exists() or path.stat().st_size == 0:
        was_there = newest is not None or Path(f"{path}-wal").exists()
        return "its database is gone or empty" if was_there else ""
    try:
        with closing(
            sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, isolation_level=None)
        ) as database:
            database.execute("BEGIN")  # all that is read is of one moment, also while a mapper writes
            return _fault(database, path, newest if newest and newest.kernel_boot == kernel_boot else None)
    except SQLITE_ERRORS as error:
        if not is_damage(error):
            raise
        return str(error)


def _fault(database: sqlite3.Connection, path: Path, newest: Newest | None) -> str:
    version = _version(database, path)
    (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    if found != "ok":
        return found
    if version == 0 and newest:
        return "all its commits are gone"
    if version in (0, 2):
        return ""
    tables = _TABLES[version]
    damaged = {table: sum(row is None for row in _rows(database, table)) for table in tables}
    named = [f"{count} rows of its table {table} do not fit" for table, count in damaged.items() if count]
    empty = [table for table in _OF_ONE_ROW if table in tables and len(list(_rows(database, table))) != 1]
    unchained = _unchained(database) if "chain" in tables and not named else []
    found = "; ".join(named or [f"its table {table} is empty" for table in empty] or unchained)
    return found or (_lacking(database, newest) if newest and "elapsed" in tables else "")


def _unchained(database: sqlite3.Connection) -> list[str]:
    """Of which tables a row is missing, or stands there that was not committed, in words; every row is sound."""
    committed = {table: (held, xored) for table, held, xored, _ in database.execute("SELECT * FROM chain")}
    return [
        f"the rows of its table {table} are not those that were committed"
        for table in _CHAINED
        if committed.get(table) != _links(database, table)
    ]


def _links(database: sqlite3.Connection, table: str) -> tuple[int, bytes]:
    """How many rows a sound table has, and the XOR of their checksums."""
    links = [link for (link,) in database.execute(f"SELECT checksum FROM {table} NOT INDEXED")]
    return len(links), reduce(_xored, links, bytes(16))


def _xored(one: bytes, other: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(one, other, strict=True))


def _begin_chain(database: sqlite3.Connection) -> None:
    """Chain the rows that a sound store has, where they are not chained yet."""
    if database.execute("SELECT 1 FROM chain").fetchone() is None:
        rows = [sealed((table, *_links(database, table))) for table in _CHAINED]
        database.executemany("INSERT INTO chain VALUES (?, ?, ?, ?)", rows)


def _keep_chain(database: sqlite3.Connection) -> None:
    """Chain what this connection inserts and deletes, in the same transaction."""
    database.execute("PRAGMA recursive_triggers = ON")  # else a row that is replaced stays in the chain
    database.create_function("xored", 2, _xored, deterministic=True)
    database.create_function("checksum", -1, checksum, deterministic=True)
    for table in _CHAINED:
        database.execute(_TRIGGER.format(table=table, event="INSERT", change=1, row="new"))
        database.execute(_TRIGGER.format(table=table, event="DELETE", change=-1, row="old"))


def _lacking(database: sqlite3.Connection, newest: Newest) -> str:
    """Which commits of a sound store are gone; empty if none."""
    counted_s, contours = counts(database)
    if counted_s >= newest.elapsed_s and contours >= newest.contours:
        return ""
    lost_s = newest.elapsed_s - counted_s
    return "its newest commits are gone" + (f" ({lost_s:.1f} s)" if lost_s >= 0.05 else "")


def counts(database: sqlite3.Connection) -> tuple[float, int]:
    """The seconds that a sound store has counted, and up to which number contours may be numbered."""
    return database.execute("SELECT seconds, version FROM elapsed, contour").fetchone()


def held(path: Path) -> int:
    """How many sweeps the sound store at ``path`` holds. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as database:
        if not database.execute("SELECT 1 FROM sqlite_master WHERE name = 'sweep'").fetchone():
            return 0  # its first opening was cut off
        return database.execute("SELECT count(*) FROM sweep").fetchone()[0]


def _connected(path: Path, now: Instant, contours: int) -> sqlite3.Connection:
    """The sound store at ``path``, where no contour gets a number up to ``contours``."""
    database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    database.execute("PRAGMA journal_mode = WAL")
    database.execute(f"PRAGMA synchronous = {UNSYNCED}")
    version = _version(database, path)
    with _writing(database):
        if version in (2, 3):
            _convert(database)
        _create(database)
        if database.execute("SELECT * FROM contour").fetchone() is None:
            database.execute("INSERT INTO contour VALUES (?, ?)", sealed((0,)))
        _note_contours_at_least(database, contours)
        if database.execute("SELECT * FROM elapsed").fetchone() is None:
            database.execute("INSERT INTO elapsed VALUES (?, ?, ?, ?)", sealed(astuple(_NOTHING_COUNTED.at(now))))
        _begin_chain(database)
    _keep_chain(database)
    return database


def note_contours(database: sqlite3.Connection, version: int) -> None:
    """Contours may have been numbered up to ``version``, in the caller's transaction."""
    database.execute("UPDATE contour SET version = ?, checksum = ?", sealed((version,)))


def _note_contours_at_least(database: sqlite3.Connection, version: int) -> None:
    note_contours(database, max(version, *database.execute("SELECT version FROM contour").fetchone()))


@contextmanager
def _writing(database: sqlite3.Connection) -> Iterator[None]:
    """All in one transaction, tables too."""
    with database:
        database.execute("BEGIN IMMEDIATE")
        yield


def _create(database: sqlite3.Connection) -> None:
    for statement in _SCHEMA:
        database.execute(statement)
    database.execute(f"PRAGMA user_version = {VERSION}")


def _version(database: sqlite3.Connection, path: Path) -> int:
    """2 to 5, or 0 of a file whose first opening was cut off. Raises StoreError and sqlite3.Error."""
    (version,) = database.execute("PRAGMA user_version").fetchone()
    tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    made = _version_of_tables(database, tables)
    if version == made:
        return version
    later = version > VERSION and _columns(database) != _own_columns()  # else a bit has flipped in the number
    if made and not later:
        raise sqlite3.DatabaseError(f"its format is {version}, and its tables are those of {made}")
    raise StoreError(
        f"{path} has format {version}, this mapper reads {VERSION}: stop the mapper, move the whole folder "
        f"{path.parent} away and start the mapper again; it reads what the gateways' logs still hold"
    )


def _columns(database: sqlite3.Connection) -> set[tuple[str, str]]:
    """The columns of all tables, each with its table."""
    return set(
        database.execute(
            "SELECT m.name, c.name FROM sqlite_master m, pragma_table_info(m.name) c WHERE m.type = 'table'"
        )
    )


@cache
def _own_columns() -> set[tuple[str, str]]:
    with closing(sqlite3.connect(":memory:")) as database:
        _create(database)
        return _columns(database)


def _version_of_tables(database: sqlite3.Connection, tables: set[str]) -> int | None:
    """Which version made these tables; 0 where there are none, None where they are no store's."""
    if not set(_BEFORE_4) <= tables:
        return None if tables else 0
    columns = {name for _, name, *_ in database.execute("PRAGMA table_info(sweep)")}
    if "entered_elapsed_s" in columns:
        return next((version for version in (VERSION, 4) if set(_TABLES[version]) <= tables), None)
    return 3 if "checksum" in columns else 2


def _convert(database: sqlite3.Connection) -> None:
    """Make the tables of a store of version 2, or of a sound one of version 3, again in those of this version."""
    for table in _BEFORE_4:
        columns = [name for _, name, *_ in database.execute(f"PRAGMA table_info({table})") if name != "checksum"]
        rows = database.execute(f"SELECT {', '.join(columns)} FROM {table} ORDER BY rowid").fetchall()
        database.execute(f"DROP TABLE {table}")
        _create(database)
        _insert(database, table, (_of_version_3(table, row) for row in rows))


def _of_version_3(table: str, row: tuple[Any, ...]) -> tuple[Any, ...]:
    """A row of version 3 without its checksum, in this version. Its age begins now: the clock of its time may have been
    set.
    """
    if table == "sweep":
        unit, log_id, log_sequence, start_ns, *others = row
        return unit, log_id, log_sequence, "", start_ns, 0.0, *others
    if table == "set_aside":
        log_id, log_sequence, unit, _, *others = row
        return log_id, log_sequence, unit, 0.0, *others
    return row


def _insert(database: sqlite3.Connection, table: str, rows: Iterable[tuple[Any, ...]]) -> int:
    """Insert rows that have no checksum yet, but those that are there already; how many."""
    added = 0
    for row in map(sealed, rows):
        marks = ", ".join("?" * len(row))
        added += database.execute(f"INSERT OR IGNORE INTO {table} VALUES ({marks})", row).rowcount
    return added


def _rows(database: sqlite3.Connection, table: str) -> Iterator[tuple[Any, ...] | None]:
    """The rows of a table, and None for each one that does not fit. Raises sqlite3.Error."""
    for row in database.execute(f"SELECT * FROM {table} NOT INDEXED"):
        yield row if checksum(*row[:-1]) == row[-1] else None


def _rebuild(path: Path, damage: str, now: Instant, contours: int) -> str:
    """Set the store aside and put a fresh one in its place, with what is sound; what was done, for the operator. No
    contour gets a number up to ``contours``.
    """
    new, folder = Path(f"{path}-new"), _folder(path)
    for suffix in ("", "-journal", "-wal", "-shm"):
        Path(f"{new}{suffix}").unlink(missing_ok=True)
    folder.mkdir(parents=True)
    for suffix in _SUFFIXES:  # a copy: until the fresh one is whole, the damaged one stays where it is
        if (file := Path(f"{path}{suffix}")).exists():
            shutil.copy2(file, folder / file.name)
    with closing(sqlite3.connect(new, isolation_level=None)) as target:
        taken = _copy(path, target, now, contours, rebuilds=int(folder.suffix.removeprefix(".")))
    for suffix in _SUFFIXES[:-1]:
        Path(f"{path}{suffix}").unlink(missing_ok=True)
    new.replace(path)
    newest_commit.beside(path).unlink(missing_ok=True)  # it knows a commit that the fresh store may not have
    return (
        f"the mapper's store was damaged ({damage}): {taken} sound sweeps of it are kept, and the gateways' logs are "
        f"read again; the damaged one is in {folder}"
    )


def _folder(path: Path) -> Path:
    number = 1
    while (folder := path.parent / "set-aside" / f"{path.stem}.{number}").exists():
        number += 1
    return folder


def _copy(path: Path, target: sqlite3.Connection, now: Instant, contours: int, rebuilds: int) -> int:
    """Copy the sound rows of all but the cursors; how many sweeps. No contour bears a number for a second time."""
    with _writing(target):
        _create(target)
        taken = _insert(target, "sweep", _sound(path, "sweep"))
        _insert(target, "set_aside", _sound(path, "set_aside"))
        # Far above all that any mapper has counted to, though the clock may be wrong or the set-aside folder emptied.
        far_above = rebuilds * 2**32 + int(now.utc_s)
        _insert(target, "contour", list(_sound(path, "contour"))[:1] or [(far_above,)])
        _note_contours_at_least(target, contours)
        _insert(target, "elapsed", list(_sound(path, "elapsed"))[:1] or [astuple(_counted_at_least(target).at(now))])
        _begin_chain(target)
    return taken


def _counted_at_least(database: sqlite3.Connection) -> Elapsed:
    """A count where it was lost: that of the last row which entered."""
    (last_s,) = database.execute("SELECT max(entered_elapsed_s) FROM sweep").fetchone()
    return Elapsed(last_s or 0.0, "", 0.0)


def _sound(path: Path, table: str) -> Iterator[tuple[Any, ...]]:
    """The sound rows of a table of the damaged file without their checksums, as far as they can be read."""
    if not path.exists() or path.stat().st_size < _HEADER_BYTES:
        return
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as source:
            columns = {name for _, name, *_ in source.execute("PRAGMA table_info(sweep)")}
            for row in filter(None, _rows(source, table)):
                yield row[:-1] if "entered_elapsed_s" in columns else _of_version_3(table, row[:-1])
    except SQLITE_ERRORS:
        return
