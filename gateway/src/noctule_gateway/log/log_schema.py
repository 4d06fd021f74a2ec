"""The tables of a unit's log, and how a file of an earlier gateway gets them."""

import secrets
import sqlite3
from pathlib import Path

from noctule_gateway.errors import LogError

_STEPS = (
    # 1. committed_s is the wall clock's time of the commit, for people only: it may be wrong.
    """
    CREATE TABLE log (log_id TEXT NOT NULL, head INTEGER NOT NULL, size_bytes INTEGER NOT NULL);
    CREATE TABLE sweeps (
        log_sequence INTEGER PRIMARY KEY,
        boot INTEGER NOT NULL,
        sequence INTEGER NOT NULL,
        digest BLOB NOT NULL,
        start_tick INTEGER NOT NULL,
        committed_s REAL NOT NULL,
        record BLOB NOT NULL,
        UNIQUE (boot, sequence, digest)
    );
    INSERT INTO log VALUES (:new_log_id, 0, 0);
    """,
    # 2. Age by elapsed time (elapsed.py). What was logged before counts as new: a column's default rewrites no row.
    """
    ALTER TABLE log ADD COLUMN elapsed_s REAL NOT NULL DEFAULT 0;
    ALTER TABLE log ADD COLUMN kernel_boot TEXT NOT NULL DEFAULT '';
    ALTER TABLE log ADD COLUMN since_boot_s REAL NOT NULL DEFAULT 0;
    ALTER TABLE sweeps ADD COLUMN committed_elapsed_s REAL NOT NULL DEFAULT 0;
    """,
)
VERSION = len(_STEPS)


def prepare(db: sqlite3.Connection, path: Path) -> None:
    """Bring an open file to this version, in one transaction. Raises sqlite3.Error, LogError on a later version."""
    if refuse_later(db, path) == VERSION:
        return
    with db:
        db.execute("BEGIN IMMEDIATE")
        for step in _STEPS[refuse_later(db, path) :]:
            for statement in step.split(";\n")[:-1]:
                db.execute(statement, {"new_log_id": secrets.token_hex(8)} if ":new_log_id" in statement else {})
        db.execute(f"PRAGMA user_version = {VERSION}")


def refuse_later(db: sqlite3.Connection, path: Path) -> int:
    """The file's version. Raises sqlite3.Error, and LogError where it is of a later gateway."""
    (version,) = db.execute("PRAGMA user_version").fetchone()
    if version > VERSION:
        raise LogError(f"log {path} has schema {version}, this gateway knows {VERSION}; run its own version")
    return version
