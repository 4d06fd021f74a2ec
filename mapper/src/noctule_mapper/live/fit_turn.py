"""Turns at fitting among the mappers of one host, so that all their fits together leave processors for the sweeps, and
a pause for all of them, so that a takeover goes first.

Without turns each of fifty sites may fit on a half of a processor, and on a host with two of them a sweep waited
seconds for its place in the store.
"""

import fcntl
from contextlib import suppress
from pathlib import Path
from time import monotonic, sleep
from types import TracebackType
from typing import Protocol

PAUSE_S = 5.0
_PAUSE = "fit-pause"
_LOOK_EVERY_S = 0.1


def pause(folder: Path, seconds: float = PAUSE_S) -> None:
    """Have no fit begin for so long whose turn is a file in ``folder``.

    If the file can't be written, there is no pause.
    """
    new = folder / f"{_PAUSE}-new"
    with suppress(OSError):
        new.write_text(str(monotonic() + seconds))
        new.replace(folder / _PAUSE)


class Turn(Protocol):
    """A fit is done within it."""

    def __enter__(self) -> None:
        """Wait until a fit may begin."""

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """The fit is done."""

    def wait_out_pause(self) -> None:
        """Wait until there is no pause."""


class FreeTurn:
    """The turn of a map that shares its host with no other: it never waits."""

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        pass

    def wait_out_pause(self) -> None:
        pass


class FitTurn:
    """Waits until no other process holds the lock on ``path``, and there is no pause; with a killed process its lock
    has gone.
    """

    def __init__(self, path: Path) -> None:
        self._file, self._pause = path.open("a"), path.with_name(_PAUSE)

    def __enter__(self) -> None:
        fcntl.flock(self._file, fcntl.LOCK_EX)
        self.wait_out_pause()

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        fcntl.flock(self._file, fcntl.LOCK_UN)

    def wait_out_pause(self) -> None:
        while self._is_paused():
            sleep(_LOOK_EVERY_S)

    def _is_paused(self) -> bool:
        try:
            left_s = float(self._pause.read_text()) - monotonic()
        except (OSError, ValueError):
            return False
        return 0.0 < left_s <= PAUSE_S  # one that is longer was written before the host was started again
