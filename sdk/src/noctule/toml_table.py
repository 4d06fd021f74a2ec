"""A table of a TOML file, read field by field: every mistake of a file is named at once, by line, table and field."""

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


Found = list[tuple[Place, int, str]]  # place, line (0 where it is not known) and words of each mistake

_MOST_NAMED = 20  # mistakes of one file: a screenful
_LONGEST_SHOWN = 80  # characters of a value


@dataclass
class Table:
    """The ``entries`` of one table. What is wrong goes into ``found``, and reading goes on with a value that can be.

    At end() a field that was not asked for is a mistake, for it has no effect.
    """

    file: Path
    name: str  # "" for the top of the file
    entries: dict[str, Any]
    lines: Mapping[Place, int]  # of the whole file
    found: Found = field(default_factory=list)  # of the whole file
    place: Place = ()
    asked: set[str] = field(default_factory=set)

    def mistake(self, key: str, problem: str) -> None:
        """Record what is wrong with ``key``; ``problem`` says it, and what to do."""
        where = f"{self.name}: " if self.name else ""
        line = line_of(self.lines, (*self.place, key.split("[")[0]))
        words = f"{self.file}{f', line {line}' if line else ''}: {where}{key} {problem}"
        self.found.append((self.place, line or 0, words))

    def sound(self) -> bool:
        """Whether nothing was wrong with this table and those below it so far."""
        return not any(place[: len(self.place)] == self.place for place, _, _ in self.found)

    def refuse(self) -> None:
        """Raise SiteFileError with a line for each mistake of the file, in the order of the file; none is no error."""
        words = [words for _, _, words in sorted(self.found, key=lambda each: each[1])]
        if len(words) > _MOST_NAMED:
            more = len(words) - _MOST_NAMED
            words[_MOST_NAMED:] = [f"{self.file}: and {more} more mistake{'s' if more > 1 else ''}"]
        if words:
            raise SiteFileError("\n".join(words))

    def has(self, key: str) -> bool:
        """Whether the field was written; it counts as asked for."""
        self.asked.add(key)
        return key in self.entries

    def hint(self, *missing: str) -> str:
        """What was probably written in the place of a ``missing`` field, and then counts as asked for; or nothing."""
        for key in missing:
            if written := _alike(key, self.entries.keys() - self.asked):
                self.asked.add(written)
                return f" (did you write it as {written}?)"
        return ""

    def text(self, key: str) -> str:
        """A string that is not empty; empty after a mistake."""
        value = self._required(key)
        if isinstance(value, str) and value:
            return value
        if value is not None:
            self.mistake(key, f'is {shown(value)}: give it as text, {key} = "..."')
        return ""

    def number(self, key: str, bound: Number) -> float:
        """A number within ``bound``; its largest after a mistake."""
        value = self._required(key)
        return bound.most if value is None else self._checked(key, value, bound)

    def optional_number(self, key: str, bound: Number) -> float | None:
        """The same, or None where the field was left out."""
        return self.number(key, bound) if self.has(key) else None

    def angle(self, key: str, bound: Number) -> float:
        """In radians, what the file gives in degrees; ``bound`` is in radians. Its largest after a mistake."""
        value = self._required(key)
        return bound.most if value is None else self._checked_angle(key, value, bound)

    def optional_angle(self, key: str, bound: Number) -> float | None:
        """The same, or None where the field was left out."""
        return self.angle(key, bound) if self.has(key) else None

    def integer(self, key: str, least: int, most: int) -> int:
        """A whole number from ``least`` to ``most``; the least after a mistake."""
        value = self._required(key)
        if isinstance(value, int) and not isinstance(value, bool) and least <= value <= most:
            return value
        if value is not None:
            self.mistake(key, f"is {shown(value)}: give a whole number from {least} to {most}")
        return least

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.entries[key] if self.has(key) else default
        if not isinstance(value, bool):
            self.mistake(key, f"is {shown(value)}: give true or false")
            return default
        return value

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """One of ``choices``, the first where the field was left out or is wrong."""
        value = self.entries[key] if self.has(key) else choices[0]
        if value not in choices:
            self.mistake(key, f"is {shown(value)}: choose {' or '.join(repr(choice) for choice in choices)}")
            return choices[0]
        return value

    def rows(self, key: str, columns: dict[str, Number], least: int) -> list[tuple[float, ...]]:
        """A list of at least ``least`` rows, each a number for each of ``columns``; angles as angle() gives them.

        Rows of the wrong form are left out, and there are none where the list is too short.
        """
        value = self._required(key)
        form = f"[{', '.join(columns)}]"
        if value is None:
            return []
        if not isinstance(value, list) or len(value) < least:
            self.mistake(key, f"must be a list of at least {least} {form}")
            return []
        read = []
        for index, row in enumerate(value):
            if not isinstance(row, list) or len(row) != len(columns) or not all(map(is_number, row)):
                self.mistake(f"{key}[{index}]", f"is {shown(row)}: give {form}, finite numbers")
                continue
            cells = zip(row, columns.items(), strict=True)
            read.append(tuple(self._cell(f"{key}[{index}], {name},", cell, bound) for cell, (name, bound) in cells))
        return read

    def table(self, key: str) -> "Table":
        """The table below ``key``, empty where it was left out. What is no table is read as an empty one, whose
        missing fields are no mistakes.
        """
        value = self.entries[key] if self.has(key) else {}
        found = self.found
        if not isinstance(value, dict):
            self.mistake(key, f"is {shown(value)}: make it a table, {key} = {{ ... }}")
            value, found = {}, []
        name = f"{self.name}.{key}" if self.name else f"[{key}]"
        return Table(self.file, name, value, self.lines, found, (*self.place, key))

    def tables(self, key: str) -> list["Table"]:
        """The tables of the array ``[[key]]``, each called by its number from 1; none after a mistake."""
        value = self._required(key)
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(entry, dict) for entry in value) or not value:
            self.mistake(key, f"must be an array of tables: begin each with [[{key}]]")
            return []
        return [
            Table(self.file, f"[[{key}]] {number}", entry, self.lines, self.found, (*self.place, key, number - 1))
            for number, entry in enumerate(value, start=1)
        ]

    def end(self) -> None:
        """Name what was written but not asked for."""
        for key in self.entries:
            if key not in self.asked:
                meant = _alike(key, self.asked)
                known = f"did you mean {meant}?" if meant else f"correct or remove it (known: {_listed(self.asked)})"
                self.mistake(key, f"is not known here: {known}")

    def _required(self, key: str) -> Any:
        """What was written; None, which TOML can't say, where that is nothing."""
        if not self.has(key):
            self.mistake(key, f"is missing: add it{self.hint(key)}")
        return self.entries.get(key)

    def _cell(self, key: str, value: float, bound: Number) -> float:
        return self._checked_angle(key, value, bound) if bound.unit == "rad" else self._checked(key, value, bound)

    def _checked(self, key: str, value: object, bound: Number) -> float:
        if not is_number(value):
            self.mistake(key, f"is {shown(value)}: give a finite number")
        elif not bound.least <= value <= bound.most:
            self.mistake(key, f"is {shown(value)}: {bound.allowed()}")
        else:
            return float(value)
        return bound.most

    def _checked_angle(self, key: str, value: object, bound: Number) -> float:
        if not is_number(value):
            self.mistake(key, f"is {shown(value)}: give a finite number")
        elif not bound.least <= math.radians(value) <= bound.most:
            self.mistake(key, f"is {shown(value)}: {bound.allowed(math.degrees(1), 'degrees')}")
        else:
            return math.radians(value)
        return bound.most


def shown(value: object) -> str:
    """A value as a mistake quotes it: no longer than a line."""
    try:
        text = repr(value)
    except ValueError:
        return "a number of thousands of digits"  # which Python does not write out
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:_LONGEST_SHOWN]}..."


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether ``value`` is a finite number; TOML's booleans, nan and inf are not."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _LARGEST


def _alike(key: str, others: Iterable[str]) -> str | None:
    return next(iter(difflib.get_close_matches(key, others, 1, _ALIKE)), None)


def _listed(keys: Iterable[str]) -> str:
    return ", ".join(sorted(keys))
