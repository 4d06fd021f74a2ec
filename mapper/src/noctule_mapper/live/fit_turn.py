"""Turns at fitting among the mappers of one host, so that all their fits together leave processors for the sweeps.

Without turns each of fifty sites may fit on a half of a processor, and on a host with two of them a sweep waited
seconds for its place in the store.
"""

import fcntl
from pathlib import Path
from types import TracebackType


class FitTurn:
    """A context that waits until no other process holds the lock on ``path``; with a killed one its lock has gone."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("a")

    def __enter__(self) -> None:
        fcntl.flock(self._file, fcntl.LOCK_EX)

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        fcntl.flock(self._file, fcntl.LOCK_UN)
