"""What a mapper's store holds, read beside the mapper that writes it."""

import sqlite3
from contextlib import closing
from pathlib import Path


def stored_sweeps(store: Path) -> int:
    """How many sweeps are in the database; none as long as the mapper has not made it."""
    if not store.exists():
        return 0
    with closing(sqlite3.connect(f"file:{store}?mode=ro", uri=True)) as database:
        try:
            return database.execute("SELECT count(*) FROM sweep").fetchone()[0]
        except sqlite3.OperationalError:  # the mapper is making it
            return 0
