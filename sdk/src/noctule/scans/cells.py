"""What stands in one cell: a figure, perhaps with its unit, or a word."""

import re
from dataclasses import dataclass

from noctule.scans.options import DEGREES, METRES, SECONDS

_FIGURE = re.compile(r"([+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?)\s*([^\W\d]*|[°º\"])\.?", re.ASCII)
_UNITS = {"", *METRES, *DEGREES, *SECONDS}
_WORDS = re.compile(r"[^\W\d_]+|[°º\"]")
EMPTY = "empty"  # how a person names a cell that holds nothing


@dataclass(frozen=True)
class Figure:
    """A number and the unit written after it, "" where there is none."""

    value: float
    unit: str


def figure(cell: object) -> Figure | None:
    """The figure in a cell of text or of JSON, a decimal comma read as a point; None where it holds no figure."""
    if isinstance(cell, bool) or not isinstance(cell, int | float | str):
        return None
    found = _FIGURE.fullmatch(str(cell).strip())
    if not found or found[2].casefold() not in _UNITS:
        return None
    return Figure(float(found[1].replace(",", ".")), found[2].casefold())


def word(cell: object) -> str:
    """A cell as a person would name it: without blanks around it, in lower case, "empty" where nothing is in it."""
    return EMPTY if cell is None else str(cell).strip().casefold() or EMPTY


def unit_in(name: str, units: dict[str, float]) -> str | None:
    """The unit that a column's name ends in or has in brackets, as in ``range_cm`` or ``distance (mm)``."""
    words = _WORDS.findall(name.casefold())
    return words[-1] if len(words) > 1 and words[-1] in units else None
