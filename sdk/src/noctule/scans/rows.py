"""The lines of a scanner's file as rows of cells, whichever way the program parted them.

The dialect is the one in which most lines hold a figure in each column that was asked for.
"""

import csv
import difflib
import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from noctule.errors import ScanError
from noctule.scans.cells import figure
from noctule.scans.lines import Line

Cells = Mapping[str, object]
"""By the column's name in lower case, and by its number from 1."""

_SAMPLE = 200  # lines that tell the dialect
_PREAMBLE = 20  # lines before the first reading, at most: greetings, a header, a first line cut in half
_LABEL = re.compile(r"(?:^|[\s,;|]+)([^\W\d][\w()]*)\s*[:=]\s*")
_SHOWN = 60  # characters of a line


@dataclass(frozen=True)
class Row:
    """One line's cells."""

    line: Line
    cells: Cells


@dataclass(frozen=True)
class Table:
    """The rows from the first reading on; ``names`` are the columns' own, in the file's spelling."""

    rows: list[Row]
    names: tuple[str, ...]
    preamble: list[Line]  # what came before and is neither reading nor header


@dataclass(frozen=True)
class _Dialect:
    split: Callable[[str], list[str]]
    names: tuple[str, ...] = ()  # of the header
    header: Line | None = None
    labels: bool = False  # each cell bears its name

    def cells(self, text: str) -> Cells:
        if self.labels:
            parts = _LABEL.split(text)
            names, values = parts[1::2], [part.strip(" ,;|\t") for part in parts[2::2]]
        else:
            names, values = self.names, self.split(text)
        numbered = {str(number): value for number, value in enumerate(values, start=1)}
        return numbered | {_key(name): value for name, value in zip(names, values, strict=False)}


def table(file: Path, lines: list[Line], columns: Iterable[str], is_reading: Callable[[Cells], bool]) -> Table:
    """The rows of ``lines``, which hold the ``columns`` by name or number.

    Raises ScanError where a column is not there, where no line is a reading, or where a line of JSON is none.
    """
    if lines[0].text.lstrip().startswith(("{", "[")):
        rows = list(_json_rows(file, lines))
        return Table(rows, tuple(rows[0].cells) if rows else (), [])
    named = [column for column in columns if not column.isascii() or not column.isdigit()]
    dialects = [_with_header(split, lines, named) for split in (_by(";"), _by("\t"), _by("|"), _by(","), str.split)]
    dialects.append(_Dialect(str.split, labels=True))
    best = max(dialects, key=lambda dialect: sum(is_reading(dialect.cells(line.text)) for line in lines[:_SAMPLE]))
    rows = [Row(line, best.cells(line.text)) for line in lines if not _repeats(line, best.header)]
    first = next((index for index, row in enumerate(rows[:_PREAMBLE]) if is_reading(row.cells)), None)
    if first is None:
        raise _no_readings(file, lines, dialects, named)
    return Table(rows[first:], best.names, [row.line for row in rows[:first]])


def lookup(cells: Cells, column: str) -> object:
    """The cell in a column named by name or number. Raises KeyError where the row has none."""
    return cells[_key(column)]


def _key(name: str) -> str:
    return name.strip().casefold()


def _by(delimiter: str) -> Callable[[str], list[str]]:
    def split(text: str) -> list[str]:
        try:
            return [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter, skipinitialspace=True))]
        except (csv.Error, StopIteration):  # a cell beyond the library's limit
            return [text]

    return split


def _with_header(split: Callable[[str], list[str]], lines: list[Line], named: list[str]) -> _Dialect:
    """The dialect with the header that has all the ``named`` columns; without one where columns go by number."""
    for line in lines[:_PREAMBLE]:
        names = split(line.text)
        if named and {_key(name) for name in named} <= {_key(name) for name in names}:
            return _Dialect(split, tuple(names), line)
    names = split(lines[0].text)
    if named or any(figure(name) for name in names):
        return _Dialect(split)
    return _Dialect(split, tuple(names), lines[0])  # by its number a column needs no header, but a header tells units


def _repeats(line: Line, header: Line | None) -> bool:
    """Whether a line is the header, or the header once more: a scanner that started again prints it again."""
    return header is not None and line.text.strip() == header.text.strip()


def _no_readings(file: Path, lines: list[Line], dialects: list[_Dialect], named: list[str]) -> ScanError:
    text = next((dialect.header.text for dialect in dialects if dialect.header), None)
    if named and text is None:
        head = max((dialect.split(lines[0].text) for dialect in dialects), key=len)
        labels = {_key(label): label for label in _LABEL.findall(lines[0].text) or head}
        missing = [name for name in named if _key(name) not in labels]
        others = [label for key, label in labels.items() if key not in map(_key, named)]
        asked = " and ".join(map(repr, missing or named))
        meant = [like for name in missing for like in difflib.get_close_matches(name, others, 1)]
        hint = f"did you mean {' and '.join(map(repr, meant))}?" if meant else "name columns as it does, or by number"
        begins = _shown(lines[0].text)
        return ScanError(file, f"no line names the columns {asked}; the file begins with {begins}: {hint}")
    if text is not None and all(line.text.strip() == text.strip() for line in lines):
        return ScanError(file, f"names its columns, {_shown(text)}, and holds no readings below")
    after = lines[min(1 if text else 0, len(lines) - 1)]
    return ScanError(
        file, f"is {_shown(after.text)}: no figures in the columns asked for; correct --angle and --range", after.place
    )


def _json_rows(file: Path, lines: list[Line]) -> Iterator[Row]:
    for line in lines:
        try:
            entry = json.loads(line.text)
        except (ValueError, RecursionError) as error:
            if line.is_cut:
                yield Row(line, {})
                continue
            raise ScanError(file, f"is no JSON ({error}): give one object on each line", line.place) from error
        if not isinstance(entry, dict):
            raise ScanError(file, f"is {_shown(line.text)}: give one object on each line", line.place)
        if "readings" in entry:
            raise ScanError(file, "holds a sweep: this is a survey already, give it to noctule-mapper fit", line.place)
        yield Row(line, {_key(name): value for name, value in entry.items()})


def _shown(text: str) -> str:
    return repr(text if len(text) <= _SHOWN else text[:_SHOWN] + "...")
