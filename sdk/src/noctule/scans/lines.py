"""A scanner's file as lines of text, whatever program wrote it."""

import codecs
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from noctule.errors import ScanError

_BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_COMMENT_SIGNS = ("#", "%", "//")
_MONITOR_TIME = re.compile(r"^\s*\d\d:\d\d:\d\d(?:\.\d+)?\s*->\s*")  # of the Arduino IDE's serial monitor
_NUMBER = r"-?\d+(?:\.\d+)?"
# Two records at least: angle, a sign, range, another sign that ends the record.
_RECORDS = re.compile(
    rf"\s*{_NUMBER}\s*(?P<between>[,*:;/])\s*{_NUMBER}\s*(?P<end>(?!(?P=between))[.#;|/!])"
    rf"\s*{_NUMBER}\s*(?P=between)\s*{_NUMBER}\s*(?P=end)"
)


@dataclass(frozen=True)
class Line:
    """A line without its end, or one of several records in it, and how messages name it; ``is_cut`` where the file
    may end inside it.
    """

    place: str  # "line 12"
    text: str
    is_cut: bool = False


def lines(file: Path) -> list[Line]:
    """The lines of ``file`` that hold something, comments left out. Raises ScanError where it is not text."""
    texts = _text(file).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept = [
        Line(f"line {number}", _MONITOR_TIME.sub("", text), is_cut=number == len(texts))
        for number, text in enumerate((text.strip("\0") for text in texts), start=1)
        if text.strip() and not text.lstrip().startswith(_COMMENT_SIGNS)
    ]
    if not kept:
        raise ScanError(file, "holds no readings: it is empty, or all comments")
    return [record for line in kept for record in _records(line)]


def _records(line: Line) -> Iterator[Line]:
    """The records of a line that ends them by a sign of its own, as in ``15,40.16,41.``; else the line itself."""
    signs = _RECORDS.match(line.text)
    if not signs:
        yield line
        return
    between, end = re.escape(signs["between"]), re.escape(signs["end"])
    record = re.compile(rf"\s*({_NUMBER})\s*{between}\s*({_NUMBER})\s*{end}(?=\s*(?:{_NUMBER}\s*{between}|[-\d]*\s*$))")
    at = number = 0
    while found := record.match(line.text, at):
        at, number = found.end(), number + 1
        yield Line(f"{line.place}, reading {number}", f"{found[1]}\t{found[2]}")
    if rest := line.text[at:].strip():
        yield Line(f"{line.place}, reading {number + 1}", rest, is_cut=line.is_cut)


def _text(file: Path) -> str:
    try:
        data = file.read_bytes()
    except OSError as error:
        raise ScanError(file, f"can't be read: {error.strerror}") from error
    for mark, encoding in _BYTE_ORDER_MARKS.items():  # PowerShell redirects into UTF-16
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, errors="replace")
    data = data.rstrip(b"\0")  # what a power cut leaves
    if b"\0" in data:
        raise ScanError(file, f"is not text (byte {data.index(0)}): export it from its program as CSV")
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")  # its figures are the same in all the old code pages
