"""The folder of recordings: files named by day and a running number, how much of them is kept, and which day is which.

The number grows with each file, so the order of days does not depend on the host's clock, which may have been wrong.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from noctule.errors import NoctuleError

_NAME = re.compile(r"(\d{4}-\d\d-\d\d)\.(\d{6,})\.rrd")


class RecordingsError(NoctuleError):
    """A folder of recordings that is none, or has no such day."""


@dataclass(frozen=True)
class Day:
    """The recordings of one day, the oldest first."""

    name: str
    files: tuple[Path, ...]

    @property
    def size_bytes(self) -> int:
        return sum(file.stat().st_size for file in self.files)


def days(folder: Path) -> list[Day]:
    """All days in ``folder``, the one recorded last at the end. Other files in it are left alone."""
    by_day: dict[str, list[Path]] = {}
    for _, day, file in sorted(_numbered(folder)):
        by_day.setdefault(day, []).append(file)
    found = [Day(name, tuple(files)) for name, files in by_day.items()]
    return sorted(found, key=lambda each: _number(each.files[-1]))


def recorded(folder: Path) -> list[Day]:
    """All days in ``folder``, at least one. Raises RecordingsError."""
    found = days(folder)
    if not found:
        raise RecordingsError(f"there are no recordings in {folder}: noctule-viewer run --record {folder} makes them")
    return found


def chosen(folder: Path, name: str | None) -> Day:
    """The day of that name as ``2026-11-28``, or the last. Raises RecordingsError."""
    found = recorded(folder)
    if name is None:
        return found[-1]
    for day in found:
        if day.name == name:
            return day
    known = ", ".join(day.name for day in found)
    raise RecordingsError(f"there is no recording of {name} in {folder}: it has {known}")


def newest(folder: Path) -> Path | None:
    """The file that was begun last, of those that hold anything."""
    return max((each for each in _numbered(folder) if each[2].stat().st_size > 0), default=(0, "", None))[2]


def next_file(folder: Path, today: date) -> Path:
    """A name for the recording that begins now."""
    last = max((number for number, _, _ in _numbered(folder)), default=0)
    return folder / f"{today.isoformat()}.{last + 1:06d}.rrd"


def outdated(folder: Path, keep_days: int, today: str) -> Sequence[Path]:
    """The files of all days but ``today``, recorded or not yet, and the ``keep_days - 1`` others recorded last."""
    others = [day for day in days(folder) if day.name != today]
    return [file for day in others[: max(len(others) - (keep_days - 1), 0)] for file in day.files]


def _numbered(folder: Path) -> list[tuple[int, str, Path]]:
    """Number, day and path of each recording."""
    names = ((_NAME.fullmatch(file.name), file) for file in folder.iterdir()) if folder.is_dir() else ()
    return [(int(name[2]), name[1], file) for name, file in names if name]


def _number(file: Path) -> int:
    name = _NAME.fullmatch(file.name)
    assert name is not None
    return int(name[2])
