"""What an error of SQLite says: that the file is damaged, or that something around it is wrong, which may pass."""

import sqlite3

# A damaged file can put bytes that are no text into SQLite's own message.
SQLITE_ERRORS = (sqlite3.Error, UnicodeDecodeError)

_AROUND = {
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_PERM,
    sqlite3.SQLITE_NOMEM,
    sqlite3.SQLITE_READONLY,
}


def primary_code(error: sqlite3.Error | UnicodeDecodeError) -> int:
    """SQLite's code of the kind of error; SQLITE_CORRUPT where Python names none."""
    return getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF


def is_damage(error: sqlite3.Error | UnicodeDecodeError) -> bool:
    """Whether the file itself is the trouble."""
    return primary_code(error) not in _AROUND
