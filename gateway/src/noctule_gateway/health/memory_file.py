"""A judge's memory in a file beside the unit's log, so that a restart of the gateway hides no fault.

The file may be lost: the past is then learnt anew, from sweeps that nobody has judged against another.
"""

import json
import math
from pathlib import Path
from typing import Any

from noctule_gateway.health.judge import Finding, Memory
from noctule_gateway.health.past import Past
from noctule_gateway.health.vocabulary import FAULTS

_VERSION = 1


def path_for(log: Path) -> Path:
    """u7.health beside u7.sqlite."""
    return log.with_suffix(".health")


def to_json(memory: Memory) -> str:
    """The memory as one line; ranges in tenths of a millimetre, null for silence."""
    past = memory.past
    return json.dumps(
        {
            "version": _VERSION,
            "place": memory.place,
            "bearing_rad": past.bearing_rad,
            "skipped": past.skipped,
            "rows": [[None if math.isnan(one_m) else round(one_m, 4) for one_m in row] for row in past.rows],
            "usual": memory.usual,
            "findings": [[one.kind, one.since_ns, one.confidence, one.words, one.absent] for one in memory.findings],
        }
    )


def from_json(text: str) -> Memory:
    """Raises ValueError where the text is not a memory."""
    try:
        found: dict[str, Any] = json.loads(text)
        if found["version"] != _VERSION:
            raise ValueError(f"version {found['version']}")
        rows = [tuple(math.nan if one_m is None else float(one_m) for one_m in row) for row in found["rows"]]
        if any(len(row) != len(found["bearing_rad"]) for row in rows):
            raise ValueError("a row of another length")
        findings = tuple(Finding(*one) for one in found["findings"] if one[0] in FAULTS)
        past = Past([float(each) for each in found["bearing_rad"]], rows, int(found["skipped"]))
        place, usual = tuple(map(float, found["place"])), tuple(map(float, found["usual"]))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(repr(error)) from error
    return Memory(place, past, usual, findings)


def read(path: Path) -> Memory:
    """An empty memory where there is no file. Raises ValueError and OSError where it can't be read."""
    return from_json(path.read_text()) if path.exists() else Memory()


def write(path: Path, text: str) -> None:
    """Replace the file. Raises OSError."""
    new = path.with_name(f"{path.name}-new")
    new.write_text(text)
    new.replace(path)
