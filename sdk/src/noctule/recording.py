"""A file of sweeps that is being recorded: what was appended survives a crash, and the file says where it got to."""

import fcntl
import os
from collections.abc import Sequence
from pathlib import Path

from noctule import survey
from noctule.errors import SurveyError
from noctule.messages_pb2 import Cursor, Sweep

JOURNAL_SUFFIX = ".jsonl"


class Recording:
    """Sweeps as JSON lines, appended for good. MCAP is written whole at the end, from a journal beside it."""

    def __init__(self, path: Path, site: str) -> None:
        """Go on with the file at ``path``, or begin it. Raises SurveyError where it holds something else."""
        self._path = path
        self._is_mcap = path.suffix == survey.MCAP_SUFFIX
        self._journal = path.with_name(path.name + JOURNAL_SUFFIX) if self._is_mcap else path
        if self._is_mcap and path.exists() and not self._journal.exists():
            self._unpack()
        try:
            self._file = self._journal.open("ab", buffering=0)
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise SurveyError(f"{self._journal} is being recorded by another process: name another file") from error
        except OSError as error:
            raise SurveyError(f"{self._journal} can't be written: {error.strerror}") from error
        self.cursors: dict[str, Cursor] = {}
        self._resume(site)

    def append(self, sweeps: Sequence[Sweep]) -> None:
        """Put sweeps on the disk. Raises OSError, and then the file is as before."""
        size = self._file.seek(0, os.SEEK_END)
        data = memoryview("".join(survey.to_json(sweep) + "\n" for sweep in sweeps).encode())
        try:
            while data:
                data = data[self._file.write(data) :]
            os.fsync(self._file.fileno())
        except OSError:
            self._file.truncate(size)
            raise
        for sweep in sweeps:
            self._note(sweep)

    def close(self) -> None:
        """Finish the file."""
        self._file.close()
        if self._is_mcap:
            self._pack()

    def _note(self, sweep: Sweep) -> None:
        self.cursors[sweep.unit] = Cursor(unit=sweep.unit, log_id=sweep.log_id, log_sequence=sweep.log_sequence)

    def _resume(self, site: str) -> None:
        """Find the cursors; a crash can have left half a line at the end, an editor a whole one without its end."""
        size = 0
        for number, line in enumerate(self._journal.read_bytes().splitlines(keepends=True), start=1):
            if not line.strip():
                size += len(line)
                continue
            whole = line.endswith(b"\n")
            try:
                sweep = survey.from_json(line.decode(errors="replace"), f"{self._journal}, line {number}")
            except SurveyError:
                if whole or not line.startswith(b"{"):
                    raise
                self._file.truncate(size)
                return
            size += len(line)
            if sweep.site == site:
                self._note(sweep)
            if not whole:
                self._file.write(b"\n")

    def _unpack(self) -> None:
        part = self._journal.with_name(self._journal.name + ".part")
        with part.open("w", encoding="utf-8") as stream:
            survey.write(survey.read(self._path), stream)
        part.replace(self._journal)

    def _pack(self) -> None:
        from noctule import survey_mcap  # only here, for it needs the extra noctule[cli]

        part = self._path.with_name(self._path.name + ".part")
        with part.open("wb") as stream:
            survey_mcap.write(survey.read(self._journal), stream)
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(self._path)
        self._journal.unlink()
