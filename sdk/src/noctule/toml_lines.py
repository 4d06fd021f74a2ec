"""On which line of a TOML file a key stands, which Python's own reader does not say.

It looks at the beginnings of lines, so inside a text of several lines it may see a key that is none.
"""

import re
from collections import Counter
from collections.abc import Mapping

Place = tuple[str | int, ...]  # the names of the tables, with the number of the element in an array, and the key

_PART = r"""[\w-]+|"[^"]*"|'[^']*'"""
_KEYS = rf"(?:{_PART})(?:\s*\.\s*(?:{_PART}))*"
_LINE = re.compile(rf"\s*(?:(?P<array>\[\[)|(?P<table>\[))?\s*(?P<keys>{_KEYS})\s*(?(array)\]\]|(?(table)\]|=))")


def lines(text: str) -> dict[Place, int]:
    """By place, the line of each table's header and each key that begins a line, from 1."""
    found: dict[Place, int] = {}
    elements: Counter[Place] = Counter()
    table: Place = ()
    for number, line in enumerate(text.splitlines(), start=1):
        match = _LINE.match(line)
        if match is None:
            continue
        parts = [part.strip("\"'") for part in re.findall(_PART, match["keys"])]
        if match["array"]:
            array = _resolved(parts, elements)
            elements[array] += 1
            table = (*array, elements[array] - 1)
        elif match["table"]:
            table = _element(_resolved(parts, elements), elements)
        found.setdefault(table if match["array"] or match["table"] else (*table, *parts), number)
    return found


def line_of(found: Mapping[Place, int], place: Place) -> int | None:
    """The line of ``place``, else of what it lies in: an inline table stands on the line of its key."""
    while place and place not in found:
        place = place[:-1]
    return found.get(place)


def _resolved(parts: list[str], elements: Mapping[Place, int]) -> Place:
    """The place that a header names: below an array it means the array's last element."""
    place: Place = ()
    for part in parts:
        place = (*_element(place, elements), part)
    return place


def _element(place: Place, elements: Mapping[Place, int]) -> Place:
    return (*place, elements[place] - 1) if elements.get(place) else place
