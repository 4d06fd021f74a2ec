"""A table of a TOML file, read field by field: an error names the file, line, table and field."""

import difflib
import math
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeGuard

from noctule.bounds import Number
from noctule.errors import SiteFileError
from noctule.toml_lines import Place, line_of

_LARGEST = sys.float_info.max  # TOML's whole numbers have no end
_ALIKE = 0.7  # of difflib; "seriel" and "serial" are 0.83 alike, "x_m" and "y_m" 0.67


@dataclass
class Table:
    """The ``entries`` of one table; at end() a field that was not asked for is refused, for it has no effect."""

    file: Path
    name: str  # "" for the top of the file
    entries: dict[str, Any]
    lines: Mapping[Place, int]  # of the whole file
    place: Place = ()
    asked: set[str] = field(default_factory=set)

    def error(self, key: str, problem: str) -> SiteFileError:
        """An error about ``key``; ``problem`` says what is wrong and what to do."""
        where = f"{self.name}: " if self.name else ""
        line = line_of(self.lines, (*self.place, key.split("[")[0]))
        return SiteFileError(f"{self.file}{f', line {line}' if line else ''}: {where}{key} {problem}")

    def has(self, key: str) -> bool:
        """Whether the field was written; it counts as asked for."""
        self.asked.add(key)
        return key in self.entries

    def hint(self, *missing: str) -> str:
        """What was probably written in the place of a ``missing`` field; empty where nothing looks like it."""
        written = (_alike(key, self.entries.keys() - self.asked) for key in missing)
        return next((f" (did you write it as {key}?)" for key in written if key), "")

    def text(self, key: str) -> str:
        """A string that is not empty."""
        value = self._required(key)
        if not isinstance(value, str) or not value:
            raise self.error(key, f'is {value!r}: give it as text, {key} = "..."')
        return value

    def number(self, key: str, bound: Number) -> float:
        """A number within ``bound``."""
        value = self._required(key)
        self._check(key, value, bound)
        return float(value)

    def optional_number(self, key: str, bound: Number) -> float | None:
        """The same, or None where the field was left out."""
        return self.number(key, bound) if self.has(key) else None

    def angle(self, key: str, bound: Number) -> float:
        """In radians, what the file gives in degrees; ``bound`` is in radians."""
        value = self._required(key)
        self._check_angle(key, value, bound)
        return math.radians(value)

    def optional_angle(self, key: str, bound: Number) -> float | None:
        """The same, or None where the field was left out."""
        return self.angle(key, bound) if self.has(key) else None

    def integer(self, key: str, least: int, most: int) -> int:
        """A whole number from ``least`` to ``most``."""
        value = self._required(key)
        if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
            raise self.error(key, f"is {value!r}: give a whole number from {least} to {most}")
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        if not self.has(key):
            return default
        value = self.entries[key]
        if not isinstance(value, bool):
            raise self.error(key, f"is {value!r}: give true or false")
        return value

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """One of ``choices``, the first where the field was left out."""
        value = self.entries[key] if self.has(key) else choices[0]
        if value not in choices:
            raise self.error(key, f"is {value!r}: choose {' or '.join(repr(choice) for choice in choices)}")
        return value

    def rows(self, key: str, columns: dict[str, Number], least: int) -> list[tuple[float, ...]]:
        """A list of at least ``least`` rows, each a number for each of ``columns``; angles as angle() gives them."""
        value = self._required(key)
        form = f"[{', '.join(columns)}]"
        if not isinstance(value, list) or len(value) < least:
            raise self.error(key, f"must be a list of at least {least} {form}")
        for index, row in enumerate(value):
            if not isinstance(row, list) or len(row) != len(columns) or not all(map(is_number, row)):
                raise self.error(f"{key}[{index}]", f"is {row!r}: give {form}, finite numbers")
        return [
            tuple(
                self._cell(f"{key}[{index}], {column},", cell, bound)
                for cell, (column, bound) in zip(row, columns.items(), strict=True)
            )
            for index, row in enumerate(value)
        ]

    def table(self, key: str) -> "Table":
        """The table below ``key``, empty where it was left out."""
        value = self.entries[key] if self.has(key) else {}
        if not isinstance(value, dict):
            raise self.error(key, f"is {value!r}: make it a table, {key} = {{ ... }}")
        return Table(
            self.file, f"{self.name}.{key}" if self.name else f"[{key}]", value, self.lines, (*self.place, key)
        )

    def tables(self, key: str) -> list["Table"]:
        """The tables of the array ``[[key]]``, each called by its number from 1."""
        value = self._required(key)
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value) or not value:
            raise self.error(key, f"must be an array of tables: begin each with [[{key}]]")
        return [
            Table(self.file, f"[[{key}]] {number}", entry, self.lines, (*self.place, key, number - 1))
            for number, entry in enumerate(value, start=1)
        ]

    def end(self) -> None:
        """Refuse what was written but not asked for."""
        for key in self.entries:
            if key not in self.asked:
                meant = _alike(key, self.asked)
                known = f"did you mean {meant}?" if meant else f"correct or remove it (known: {_listed(self.asked)})"
                raise self.error(key, f"is not known here: {known}")

    def _required(self, key: str) -> Any:
        if not self.has(key):
            raise self.error(key, f"is missing: add it{self.hint(key)}")
        return self.entries[key]

    def _cell(self, key: str, value: float, bound: Number) -> float:
        if bound.unit == "rad":
            self._check_angle(key, value, bound)
            return math.radians(value)
        self._check(key, value, bound)
        return float(value)

    def _check(self, key: str, value: object, bound: Number) -> None:
        if not is_number(value):
            raise self.error(key, f"is {value!r}: give a finite number")
        if not bound.least <= value <= bound.most:
            raise self.error(key, f"is {value}: {bound.allowed()}")

    def _check_angle(self, key: str, value: object, bound: Number) -> None:
        if not is_number(value):
            raise self.error(key, f"is {value!r}: give a finite number")
        if not bound.least <= math.radians(value) <= bound.most:
            raise self.error(key, f"is {value}: {bound.allowed(math.degrees(1), 'degrees')}")


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether ``value`` is a finite number; TOML's booleans, nan and inf are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _alike(key: str, others: Iterable[str]) -> str | None:
    return next(iter(difflib.get_close_matches(key, others, 1, _ALIKE)), None)


def _listed(keys: Iterable[str]) -> str:
    return ", ".join(sorted(keys))
