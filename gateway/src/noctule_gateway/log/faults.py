"""What an error of SQLite means for a log: trouble around the file, which may pass, or damage in it."""

import os
import sqlite3
from pathlib import Path

from noctule.sqlite_faults import primary_code
from noctule_gateway.errors import DamagedError, LogError

_REMEDIES = {
    sqlite3.SQLITE_FULL: "make room on the disk",
    sqlite3.SQLITE_IOERR: "see to the disk",
    sqlite3.SQLITE_CANTOPEN: "see that the folder is there and may be written to",
    sqlite3.SQLITE_READONLY: "see that the file may be written to",
    sqlite3.SQLITE_BUSY: "another program has it open: close that",
    sqlite3.SQLITE_LOCKED: "another program has it open: close that",
    sqlite3.SQLITE_PERM: "see that the file may be written to",
    sqlite3.SQLITE_NOMEM: "the machine has no memory left",
}


def log_error(path: Path, what: str, error: sqlite3.Error | UnicodeDecodeError) -> LogError:
    """``error`` as the log's own; ``what`` could not be done with it. DamagedError where the file is the trouble."""
    code = primary_code(error)
    # The header says whether a file may be written, and a bit of it may have flipped.
    blamed_on_header = code == sqlite3.SQLITE_READONLY and os.access(path, os.W_OK) and os.access(path.parent, os.W_OK)
    if code in _REMEDIES and not blamed_on_header:
        return LogError(f"log {path} can't be {what}: {error}; {_REMEDIES[code]}")
    return damaged(path, str(error))


def damaged(path: Path, reason: str) -> DamagedError:
    """The log at ``path`` is damaged."""
    return DamagedError(path, reason)
