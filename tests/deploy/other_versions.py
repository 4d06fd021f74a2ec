"""The data of a gateway and of a mapper as other versions of them leave these: the ones before, and one to come.

Sweeps, numbers and places are those of the present files, whose programs have ended. Tables are written as they were at
the last change of each format: schema 2 of a log and version 3 of a store.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from noctule.checksum import checksum

LOG_2 = """
CREATE TABLE log (log_id TEXT NOT NULL, head INTEGER NOT NULL, size_bytes INTEGER NOT NULL,
    elapsed_s REAL NOT NULL DEFAULT 0, kernel_boot TEXT NOT NULL DEFAULT '', since_boot_s REAL NOT NULL DEFAULT 0);
CREATE TABLE sweeps (
    log_sequence INTEGER PRIMARY KEY, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, digest BLOB NOT NULL,
    start_tick INTEGER NOT NULL, committed_s REAL NOT NULL, record BLOB NOT NULL,
    committed_elapsed_s REAL NOT NULL DEFAULT 0, UNIQUE (boot, sequence, digest));
INSERT INTO log SELECT log_id, head, size_bytes, elapsed_s, kernel_boot, since_boot_s FROM present.log;
INSERT INTO sweeps SELECT log_sequence, boot, sequence, digest, start_tick, committed_s, record, committed_elapsed_s
    FROM present.sweeps;
PRAGMA user_version = 2;
"""
STORE_3 = """
CREATE TABLE sweep (
    unit TEXT NOT NULL, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, start_ns INTEGER NOT NULL,
    visit INTEGER NOT NULL, place_x_m REAL NOT NULL, place_y_m REAL NOT NULL, place_heading_rad REAL NOT NULL,
    record BLOB NOT NULL, checksum BLOB NOT NULL, PRIMARY KEY (unit, log_id, log_sequence));
CREATE INDEX sweep_by_age ON sweep (start_ns);
CREATE INDEX sweep_by_place ON sweep (unit, place_x_m, place_y_m, place_heading_rad);
CREATE TABLE cursor (
    unit TEXT PRIMARY KEY, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, checksum BLOB NOT NULL);
CREATE TABLE set_aside (
    log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL, unit TEXT NOT NULL, at_ns INTEGER NOT NULL,
    reason TEXT NOT NULL, record BLOB NOT NULL, checksum BLOB NOT NULL, PRIMARY KEY (log_id, log_sequence));
CREATE TABLE contour (version INTEGER NOT NULL, checksum BLOB NOT NULL);
INSERT INTO sweep SELECT *, sealed(unit, log_id, log_sequence, start_ns, visit, place_x_m, place_y_m,
    place_heading_rad, record) FROM (SELECT unit, log_id, log_sequence, start_ns, visit, place_x_m, place_y_m,
    place_heading_rad, record FROM present.sweep ORDER BY rowid);
INSERT INTO cursor SELECT * FROM present.cursor;
INSERT INTO contour SELECT * FROM present.contour;
PRAGMA user_version = 3;
"""


def make_log_earlier(path: Path, head_file: bool = False) -> None:
    """Write the log at ``path`` as a gateway did that knew no checksums, gaps and head files; ``head_file``: the one
    that is there stays, because what made it is of this version.
    """
    _rewrite(path, LOG_2)
    if not head_file:
        Path(f"{path}-head").unlink()


def make_store_earlier(path: Path) -> None:
    """Write the store at ``path`` as a mapper did that knew no elapsed time."""
    _rewrite(path, STORE_3)


@contextmanager
def of_a_later_version(path: Path) -> Iterator[None]:
    """Within the block, the database at ``path`` is one of the next version, with a table that nobody knows yet."""
    with closing(sqlite3.connect(path)) as database, database:
        (present,) = database.execute("PRAGMA user_version").fetchone()
        database.execute("CREATE TABLE to_come (something TEXT NOT NULL)")
        database.execute(f"PRAGMA user_version = {present + 1}")
    try:
        yield
    finally:
        with closing(sqlite3.connect(path)) as database, database:
            database.execute("DROP TABLE to_come")
            database.execute(f"PRAGMA user_version = {present}")


def _rewrite(path: Path, script: str) -> None:
    other = path.with_name("other")
    with closing(sqlite3.connect(other)) as database:
        database.create_function("sealed", -1, checksum)
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("ATTACH ? AS present", (str(path),))
        database.executescript(script)
    for suffix in ("", "-wal", "-shm"):
        Path(f"{path}{suffix}").unlink(missing_ok=True)
    other.rename(path)
