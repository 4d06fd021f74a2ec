"""A file of sweeps that is being recorded: what was appended survives a crash, and the file says where it got to."""

import fcntl
import json
import logging
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

from noctule import survey
from noctule.errors import SurveyError
from noctule.messages_pb2 import Cursor, Sweep

JOURNAL_SUFFIX = ".jsonl"

_log = logging.getLogger(__name__)


class Recording:
    """Sweeps as JSON lines, appended for good. MCAP can't be appended to: its new sweeps wait in a journal beside it,
    and at the end a new file is written of the sweeps of both, which then takes the place of the old one.
    """

    def __init__(self, path: Path, site: str) -> None:
        """Go on with the file at ``path``, or begin it. Raises SurveyError where it is something else, or cut."""
        self._path = path
        self._is_mcap = path.suffix == survey.MCAP_SUFFIX
        self._journal = path.with_name(path.name + JOURNAL_SUFFIX) if self._is_mcap else path
        self.cursors: dict[str, Cursor] = {}
        self.appended = 0  # sweeps, since it was opened
        self._file = _open_locked(self._journal)
        try:
            _cut_tail(self._file, self._journal)
            for sweep in self._sweeps():
                if sweep.site == site:
                    self._note(sweep)
            _end_last_line(self._file, self._journal)
        except SurveyError:
            self._file.close()
            raise

    def append(self, sweeps: Sequence[Sweep]) -> None:
        """Put sweeps on the disk. Raises SurveyError where that fails, and then the file is as before."""
        size = self._file.seek(0, os.SEEK_END)
        data = memoryview("".join(survey.to_json(sweep) + "\n" for sweep in sweeps).encode())
        try:
            while data:
                data = data[self._file.write(data) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            self._file.truncate(size)
            raise SurveyError(f"{self._journal} can't be written: {error.strerror}: see to its disk") from error
        for sweep in sweeps:
            self._note(sweep)
        self.appended += len(sweeps)

    def close(self) -> None:
        """Finish the file."""
        with self._file:  # locked until all is done
            if self._is_mcap:
                self._pack()

    def _note(self, sweep: Sweep) -> None:
        self.cursors[sweep.unit] = Cursor(unit=sweep.unit, log_id=sweep.log_id, log_sequence=sweep.log_sequence)

    def _sweeps(self) -> Iterator[Sweep]:
        """Those of the MCAP file, then those of the journal that it does not hold."""
        if not (self._is_mcap and self._path.exists()):
            yield from survey.read(self._journal)
            return
        new = {_identity(sweep) for sweep in survey.read(self._journal)}
        try:
            for sweep in survey.read_whole(self._path):
                new.discard(_identity(sweep))
                yield sweep
        except SurveyError as error:
            raise SurveyError(f"{error}. It is left as it is: move it away, or record to another file") from error
        yield from (sweep for sweep in survey.read(self._journal) if _identity(sweep) in new)

    def _pack(self) -> None:
        """At every moment the MCAP file and the journal together hold all sweeps, also after a power cut."""
        from noctule import survey_mcap  # only here, for it needs the extra noctule[cli]

        part = self._path.with_name(self._path.name + ".part")
        with part.open("wb") as stream:
            survey_mcap.write(self._sweeps(), stream)
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(self._path)
        _sync_folder(self._path)
        self._journal.unlink()
        _sync_folder(self._path)


def _open_locked(journal: Path) -> BinaryIO:
    """The journal, there for good, for this process alone."""
    try:
        file = journal.open("ab", buffering=0)
    except OSError as error:
        raise SurveyError(f"{journal} can't be written: {error.strerror}") from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if not os.path.samestat(os.fstat(file.fileno()), journal.stat()):
            raise FileNotFoundError  # another process has just finished it
        _sync_folder(journal)
    except (BlockingIOError, FileNotFoundError) as error:
        file.close()
        raise SurveyError(f"{journal} is being recorded by another process: name another file") from error
    except OSError as error:
        file.close()
        raise SurveyError(f"{journal} can't be written: {error.strerror}") from error
    return file


def _cut_tail(file: BinaryIO, journal: Path) -> None:
    """Cut off what a power cut has left of the last line: a part of it, NULs, or both."""
    begin, tail = _last_line(journal)
    rest = tail.rstrip(b"\0")
    if rest and not rest.startswith(b"{"):
        return  # something else: the reader says so
    kept = len(rest) if _is_json(rest) else 0
    if kept < len(tail):
        file.truncate(begin + kept)
        os.fsync(file.fileno())
        _log.warning(
            "%s ended in %d bytes of a line that a crash cut off; they were removed, and its sweep is recorded again",
            journal,
            len(tail) - kept,
        )


def _end_last_line(file: BinaryIO, journal: Path) -> None:
    """An editor may have left a whole line without its end."""
    if _last_line(journal)[1]:
        file.write(b"\n")


def _last_line(journal: Path) -> tuple[int, bytes]:
    """Where the line without an end begins, and that line; empty where all lines have one."""
    begin = 0
    with journal.open("rb") as lines:
        for line in lines:
            if not line.endswith(b"\n"):
                return begin, line
            begin += len(line)
    return begin, b""


def _is_json(line: bytes) -> bool:
    try:
        json.loads(line)
    except (ValueError, RecursionError):
        return False
    return True


def _identity(sweep: Sweep) -> object:
    """What tells a sweep from another: its place in a log, or all of it where it was never in one."""
    if sweep.log_id:
        return sweep.site, sweep.unit, sweep.log_id, sweep.log_sequence
    return sweep.SerializeToString(deterministic=True)


def _sync_folder(file: Path) -> None:
    """Make durable which names the folder of ``file`` holds."""
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
