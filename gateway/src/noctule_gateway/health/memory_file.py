"""A judge's memory in a file beside the unit's log, so that a restart of the gateway hides no fault.

The first line is the CRC-32 of the second, in hexadecimal. The file may be lost: the gateway then learns again what
the unit hears, from sweeps that nobody has judged against another.
"""

import json
import math
import zlib
from pathlib import Path
from typing import Any

from noctule_gateway.disk import sync
from noctule_gateway.health.judge import Finding, Memory
from noctule_gateway.health.past import Past
from noctule_gateway.health.vocabulary import FAULTS

_VERSION = 2
_MOST_M = 1000.0  # far beyond what a time of flight can be
_MOST_NS = 9 * 10**18  # what a time may be on the bus (noctule.bounds)


def path_for(log: Path) -> Path:
    """u7.health beside u7.sqlite."""
    return log.with_suffix(".health")


def to_text(memory: Memory) -> str:
    """The memory in two lines; ranges in tenths of a millimetre, null for silence."""
    past = memory.past
    return sealed(
        json.dumps(
            {
                "version": _VERSION,
                "place": memory.pose,
                "bearing_rad": past.bearing_rad,
                "skipped": past.skipped,
                "air_measured": past.air_measured,
                "rows": [[None if math.isnan(one_m) else round(one_m, 4) for one_m in row] for row in past.rows],
                "usual": memory.usual,
                "findings": [
                    [one.kind, one.since_ns, one.clock_epoch, one.confidence, one.words, one.absent]
                    for one in memory.findings
                ],
            }
        )
    )


def sealed(content: str) -> str:
    """The content under its CRC."""
    return f"{zlib.crc32(content.encode()):08x}\n{content}\n"


def from_text(text: str) -> Memory:
    """Raises ValueError where the text is not a memory."""
    crc, _, content = text.removesuffix("\n").partition("\n")
    if text != sealed(content):
        raise ValueError(f"its CRC is not {crc[:8]!r}")
    try:
        return _memory(json.loads(content))
    except (LookupError, TypeError, AttributeError, OverflowError, RecursionError) as error:
        raise ValueError(repr(error)) from error


def read(path: Path) -> Memory:
    """An empty memory where there is no file. Raises ValueError and OSError where it can't be read."""
    return from_text(path.read_text()) if path.exists() else Memory()


def write(path: Path, text: str) -> None:
    """Replace the file; it is on the disk on return. Raises OSError."""
    new = path.with_name(f"{path.name}-new")
    new.write_text(text)
    sync(new)
    new.replace(path)
    sync(path.parent)


def _memory(found: dict[str, Any]) -> Memory:
    if found["version"] != _VERSION:
        raise ValueError(f"version {found['version']}")
    bearings_rad = [_number(each, -2 * math.pi, 2 * math.pi) for each in found["bearing_rad"]]
    rows = [
        tuple(math.nan if one_m is None else _number(one_m, 0.0, _MOST_M) for one_m in row) for row in found["rows"]
    ]
    if any(len(row) != len(bearings_rad) for row in rows):
        raise ValueError("a row of another length")
    return Memory(
        pose=tuple(_number(each) for each in found["place"]),
        past=Past(bearings_rad, rows, _count(found["skipped"]), bool(found["air_measured"])),
        usual=tuple(_number(each) for each in found["usual"]),
        findings=tuple(_finding(one) for one in found["findings"] if one[0] in FAULTS),
    )


def _finding(one: list[Any]) -> Finding:
    kind, since_ns, clock_epoch, confidence, words, absent = one
    if not isinstance(clock_epoch, str) or not isinstance(words, str):
        raise ValueError("words that are none")
    return Finding(kind, _count(since_ns), clock_epoch, _number(confidence, 0.0, 1.0), words, _count(absent))


def _number(value: Any, least: float = -math.inf, most: float = math.inf) -> float:
    if isinstance(value, str | bool) or not math.isfinite(value) or not least <= value <= most:
        raise ValueError(f"{str(value)[:20]} is not a number from {least} to {most}")
    return float(value)


def _count(value: Any) -> int:
    if type(value) is not int or not 0 <= value <= _MOST_NS:
        raise ValueError(f"{str(value)[:20]} is not a count")
    return value
