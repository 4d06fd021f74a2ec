"""A scanner's file as lines of text, whatever program wrote it."""

import codecs
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.errors import ScanError

_BYTE_ORDER_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}
_COMMENT_SIGNS = ("#", "%", "//")
_MONITOR_TIME = re.compile(r"^\s*\d\d:\d\d:\d\d(?:\.\d+)?\s*->\s*")  # of the Arduino IDE's serial monitor
# Two figures and a sign between them: a record, where another sign ends it and the next one follows on the same line.
_RECORD = re.compile(r"\s*(-?[\d.]+)\s*([,*:;])\s*(-?[\d.]+)\s*")
_RECORD_ENDS = ".#"
_MOST = 0.8  # of a line's records are whole


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
    end = next((end for end in _RECORD_ENDS if _ends_records(end, kept)), None)
    return [record for line in kept for record in _records(line, end)] if end else kept


def _ends_records(end: str, lines: Sequence[Line]) -> bool:
    """Whether each line with figures in it holds several records, as in ``15,40.16,41.``, which ``end`` ends."""
    with_figures = [line for line in lines if any(sign.isdigit() for sign in line.text)]
    return bool(with_figures) and all(_has_records(line, end) for line in with_figures)


def _has_records(line: Line, end: str) -> bool:
    *records, rest = line.text.split(end)
    whole = sum(_RECORD.fullmatch(record) is not None for record in records)
    return whole >= max(2, _MOST * len(records)) and (line.is_cut or not rest.strip())


def _records(line: Line, end: str) -> list[Line]:
    """The records of a line, each as one of its own."""
    *records, rest = line.text.split(end)
    found = [
        Line(f"{line.place}, reading {number}", _RECORD.sub(r"\1\t\3", record))
        for number, record in enumerate(records, start=1)
        if record.strip()
    ]
    return [*found, Line(f"{line.place}, reading {len(records) + 1}", rest, is_cut=True)] if rest.strip() else found


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
