"""How much a relay may keep, as Rerun is told: a number and its unit, not so little that no map fits."""

import re

from noctule.errors import NoctuleError

DEFAULT = "64MB"
LEAST_MB = 8.0
_IN_MB = {
    "kB": 1e-3,
    "KB": 1e-3,
    "MB": 1.0,
    "GB": 1e3,
    "kiB": 2**10 / 1e6,
    "KiB": 2**10 / 1e6,
    "MiB": 2**20 / 1e6,
    "GiB": 2**30 / 1e6,
}


class MemoryLimitError(NoctuleError):
    """A limit that no relay can have."""


def checked(limit: str) -> str:
    """``limit`` itself; raises MemoryLimitError unless it is like ``64MB`` and at least LEAST_MB.

    With less than that a relay would forget the map of a room before the mapper draws it again.
    """
    if in_bytes(limit) < LEAST_MB * 1e6:
        raise MemoryLimitError(f"--memory-limit {limit} is too little to keep a map: at least {LEAST_MB:g}MB")
    return limit


def in_bytes(limit: str) -> float:
    """How much that is; raises MemoryLimitError unless it is like ``64MB``."""
    match = re.fullmatch(r"(\d+(?:\.\d+)?) ?([kKMG]i?B)", limit.strip())
    if match is None:
        raise MemoryLimitError(f"--memory-limit {limit!r} is no amount of memory: write it like {DEFAULT} or 1GB")
    return float(match[1]) * _IN_MB[match[2]] * 1e6
