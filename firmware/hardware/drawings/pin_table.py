"""The chip's pins, as the table of the wiring page has them: the drawings name none themselves."""

import re
from pathlib import Path

_ROW = re.compile(r"^\| (P\d\.\d) \| (\w+) \|", re.MULTILINE)


def pins(page: Path) -> dict[str, str]:
    """The pin of each signal: ``{"ECHO": "P1.0", ...}``."""
    return {signal: pin for pin, signal in _ROW.findall(page.read_text())}
