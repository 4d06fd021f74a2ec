"""Records what the relay passes on: a process that watches it like any viewer, and writes files by day.

It is a process of its own so that neither a full disk nor its end concerns the relay.
"""

import logging
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import date
from pathlib import Path
from time import monotonic
from typing import Protocol, Self

from noctule.folder_lock import FolderError, FolderLock, Owner
from noctule_viewer.recordings import days, rrd_file

LEAST_FREE_BYTES = 500_000_000
STILL_AFTER_S = 60.0
_LARGEST_BYTES = 256_000_000  # Rerun keeps an index of a file in memory until its end: half a kilobyte for each chunk
_LOOK_EVERY_S = 1.0
_END_WITHIN_S = 1.0
FIRST_PAUSE_S, _LONGEST_PAUSE_S = 10.0, 600.0  # each start costs as much disk as the relay has memory

_log = logging.getLogger(__name__)


class Writer(Protocol):
    """A process that writes a file."""

    def poll(self) -> int | None: ...
    def terminate(self) -> None: ...
    def kill(self) -> None: ...
    def wait(self, timeout: float | None = None) -> int: ...


class Recorder:
    """Keeps a writer at work from its making until close(), one file after the other."""

    def __init__(
        self,
        folder: Path,
        keep_days: int,
        start: Callable[[Path], Writer],
        first: Callable[[], None] = lambda: None,
        today: Callable[[], date] = date.today,
        free_bytes: Callable[[Path], int] = lambda folder: shutil.disk_usage(folder).free,
        pause_s: float = FIRST_PAUSE_S,
        still_after_s: float | None = STILL_AFTER_S,
    ) -> None:
        """``start`` begins to write a file, ``first`` is called before the first one; ``keep_days`` is at least 1.

        A writer whose file has not grown for ``still_after_s`` hangs and is ended; None where nobody draws all the
        time. After a trouble it waits for ``pause_s``, and twice as long each time, up to ten minutes.
        """
        self._still_after_s = still_after_s
        self._folder, self._keep_days, self._start, self._first = folder, keep_days, start, first
        self._today, self._free_bytes = today, free_bytes
        self._trouble = ""
        self._first_pause_s = self._pause_s = pause_s
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def trouble(self) -> str:
        """Why nothing is recorded, empty while all is well. From any thread."""
        return self._trouble

    def close(self) -> None:
        """Record no more."""
        self._closed.set()
        self._thread.join(2 * _END_WITHIN_S)

    def _run(self) -> None:
        try:
            self._first()
        except OSError as error:
            self._trouble = f"the hours before are not shown: {error.strerror}"
            _log.warning("%s", self._trouble)
        while not self._closed.is_set():
            try:
                self._trouble = self._record_one_file()
            except OSError as error:
                self._trouble = f"nothing is recorded in {self._folder}: {error.strerror}"
            if self._trouble:
                _log.warning("%s; it is tried again in %.0f s", self._trouble, self._pause_s)
                self._closed.wait(self._pause_s)
                self._pause_s = min(2 * self._pause_s, _LONGEST_PAUSE_S)

    def _record_one_file(self) -> str:
        """Until the file is full, its day is over, or close(). Returns what is wrong, where something is."""
        day = self._today()
        self._delete_outdated(day)  # first of all, because it may make the room that is lacking
        if trouble := self._lack_of_space():
            return trouble
        path = days.next_file(self._folder, day)
        writer = self._start(path)
        began_s = grown_s = monotonic()
        size = 0
        try:
            while not self._closed.wait(_LOOK_EVERY_S):
                if (status := writer.poll()) is not None:
                    return f"the recorder ended by itself, with status {status}"
                if (now := path.stat().st_size if path.exists() else 0) > size:
                    size, grown_s = now, monotonic()
                elif self._still_after_s is not None and monotonic() - grown_s > self._still_after_s:
                    return f"the recorder has written nothing for {monotonic() - grown_s:.0f} s"
                self._trouble = ""
                if monotonic() - began_s > _LONGEST_PAUSE_S:
                    self._pause_s = self._first_pause_s
                if self._today() != day or size > _LARGEST_BYTES:
                    break
                if trouble := self._lack_of_space():
                    return trouble
        finally:
            _end(writer)
            if path.exists():
                rrd_file.cut_incomplete_end(path)  # Rerun ends in the middle of a message
        return ""

    def _lack_of_space(self) -> str:
        free_bytes = self._free_bytes(self._folder)
        if free_bytes >= LEAST_FREE_BYTES:
            return ""
        return (
            f"nothing is recorded: the disk of {self._folder} has {free_bytes / 1e6:.0f} MB left, and "
            f"{LEAST_FREE_BYTES / 1e6:.0f} are kept free: delete what you don't need, or keep fewer days"
        )

    def _delete_outdated(self, today: date) -> None:
        for file in days.outdated(self._folder, self._keep_days, today.isoformat()):
            file.unlink(missing_ok=True)
            _log.info("deleted %s: %d days are kept", file.name, self._keep_days)


@contextmanager
def folder_of_recordings(folder: Path) -> Iterator[Path | None]:
    """Hold ``folder``, made where it is not there; the file that was begun last in it, readable also after a power cut.

    Raises FolderError where another viewer records in it, or it can't be written to.
    """
    with FolderLock(folder, Owner("viewer", "", "recordings")):
        last = days.newest(folder)
        try:
            if last is not None and (cut := rrd_file.cut_incomplete_end(last)):
                _log.warning("%s was cut off: %d bytes of a drawing that was not complete are gone", last.name, cut)
        except OSError as error:
            raise FolderError(f"can't read {last}: {error.strerror}: move it away") from error
        yield last


def _end(writer: Writer) -> None:
    writer.terminate()
    try:
        writer.wait(_END_WITHIN_S)
    except Exception:
        writer.kill()
        writer.wait()
