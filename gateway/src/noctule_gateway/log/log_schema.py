"""The tables of a unit's log, and which gateway made a file. Files of earlier gateways are converted by rebuild.py.

Versions: 1, the first; 2 added the elapsed time to `log` and to each sweep; 3 added checksums and gaps.
"""

import secrets
import sqlite3
from functools import cache
from pathlib import Path

from noctule_gateway.errors import LogError
from noctule_gateway.log.rows import Log

VERSION = 3

# `adopted` is 0 until the head file knows this log. committed_s is the wall clock's time of the commit, for people
# only: it may be wrong. A record is looked for by an index that is not unique: a damaged index must fail no commit.
_TABLES = (
    """CREATE TABLE log (
        log_id TEXT NOT NULL,
        head INTEGER NOT NULL,
        tail INTEGER NOT NULL,
        size_bytes INTEGER NOT NULL,
        newest BLOB NOT NULL,
        adopted INTEGER NOT NULL,
        elapsed_s REAL NOT NULL,
        kernel_boot TEXT NOT NULL,
        since_boot_s REAL NOT NULL,
        checksum BLOB NOT NULL
    )""",
    """CREATE TABLE sweeps (
        log_sequence INTEGER PRIMARY KEY,
        boot INTEGER NOT NULL,
        sequence INTEGER NOT NULL,
        digest BLOB NOT NULL,
        start_tick INTEGER NOT NULL,
        committed_s REAL NOT NULL,
        committed_elapsed_s REAL NOT NULL,
        record BLOB NOT NULL,
        previous BLOB NOT NULL,
        checksum BLOB NOT NULL
    )""",
    """CREATE TABLE gaps (
        first INTEGER NOT NULL,
        last INTEGER NOT NULL,
        damaged INTEGER NOT NULL,
        found_elapsed_s REAL NOT NULL,
        reason TEXT NOT NULL,
        checksum BLOB NOT NULL
    )""",
    "CREATE INDEX sweeps_by_identity ON sweeps (boot, sequence, digest)",
)


def is_new(db: sqlite3.Connection) -> bool:
    """Whether nothing was ever written into the file. Raises sqlite3.Error."""
    return db.execute("PRAGMA page_count").fetchone() == (0,)


def create(db: sqlite3.Connection, log: Log) -> None:
    """Make the tables with the row of ``log``, in the caller's transaction. Raises sqlite3.Error."""
    for table in _TABLES:
        db.execute(table)
    db.execute("INSERT INTO log VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", log.row())
    db.execute(f"PRAGMA user_version = {VERSION}")


def new_log_id() -> str:
    """A log_id that no log has borne."""
    return secrets.token_hex(8)


def version_of(db: sqlite3.Connection, path: Path) -> int:
    """The version of a file that has tables; 0 where they are no log's. Raises sqlite3.Error.

    The tables count and not only the number, in which a bit may have flipped. Raises LogError where both are of a later
    gateway.
    """
    (version,) = db.execute("PRAGMA user_version").fetchone()
    tables = _tables(db)
    if tables == _own_tables() and (version ^ VERSION).bit_count() <= 1:
        return VERSION if version == VERSION else 0
    if version > VERSION:
        raise LogError(f"log {path} has schema {version}, this gateway knows {VERSION}; run its own version")
    return version if version in (1, 2) else 0


def _tables(db: sqlite3.Connection) -> list[tuple[str, str]]:
    return db.execute("SELECT name, sql FROM sqlite_master ORDER BY name").fetchall()


@cache
def _own_tables() -> list[tuple[str, str]]:
    db = sqlite3.connect(":memory:")
    for table in _TABLES:
        db.execute(table)
    tables = _tables(db)
    db.close()
    return tables
