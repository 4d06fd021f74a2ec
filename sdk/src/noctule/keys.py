"""The key scheme of the bus: every key is built and parsed here, never by hand.

SUBJECTS is the table of all keys. Where a key is to match several, ANY stands for a name. A chunk that begins with
``@`` is verbatim in Zenoh: ``**`` does not match it, so data never mixes with logs, commands or another major version.
"""

import re
from dataclasses import dataclass

from noctule.errors import KeyFormatError

ROOT = "noctule/@v1"
ANY = "*"
LONGEST_NAME = 64
_NAMES = ("site", "unit", "service", "command")  # chunks that only a name() may fill
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


@dataclass(frozen=True)
class Subject:
    """What one kind of key carries.

    ``key`` follows ROOT, with the names that vary in braces. ``message`` is the full name of what is published, or of
    the reply where the key is queried; empty where the key alone says it.
    """

    key: str
    message: str
    publisher: str
    meaning: str


SUBJECTS = {
    "sweep": Subject("{site}/unit/{unit}/sweep", "noctule.v1.Sweep", "gateway", "a sweep, once it is in the log"),
    "pose": Subject("{site}/unit/{unit}/pose", "noctule.v1.Pose", "tracker", "where a moving unit is"),
    "unit_status": Subject("{site}/unit/{unit}/status", "noctule.v1.UnitStatus", "gateway", "a unit's state"),
    "log": Subject("{site}/unit/{unit}/@log", "noctule.v1.LogRecords", "gateway", "a unit's log: ?from=N;max=M"),
    "rpc": Subject("{site}/unit/{unit}/@rpc/{command}", "noctule.v1.CommandReply", "gateway", "a unit's commands"),
    "alive": Subject("{site}/unit/{unit}/@alive", "", "gateway", "a liveliness token while it serves the unit"),
    "service_status": Subject(
        "{site}/service/{service}/status", "noctule.v1.ServiceStatus", "each service", "a service's state"
    ),
    "contour": Subject("{site}/map/contour", "noctule.v1.Contour", "mapper", "the site's contour"),
    "features": Subject("{site}/map/features", "noctule.v1.Features", "mapper", "the site's feature points"),
    "grid": Subject("{site}/map/grid/{tile}", "noctule.v1.GridTile", "mapper", "one tile of the reliability grid"),
    "schema": Subject(
        "@schema/{message}", "google.protobuf.FileDescriptorSet", "gateway, mapper", "how a message is laid out"
    ),
}


def name(value: str, what: str) -> str:
    """``value`` if it may be a name in keys: up to 64 lower-case letters, digits, ``-`` and ``_``.

    Raises KeyFormatError.
    """
    if len(value) > LONGEST_NAME:
        told = f"{value[:LONGEST_NAME]!r}..."
        raise KeyFormatError(f"{what} {told} is too long for a key: {LONGEST_NAME} characters at most")
    if _NAME.fullmatch(value):
        return value
    raise KeyFormatError(f"{what} {value!r} can't be part of a key: use lower-case letters, digits, '-' and '_'")


def sweep(site: str, unit: str) -> str:
    """Key on which a unit's sweeps are published (message Sweep)."""
    return _key("sweep", site=site, unit=unit)


def pose(site: str, unit: str) -> str:
    """Key on which whoever tracks a moving unit publishes where it is (message Pose)."""
    return _key("pose", site=site, unit=unit)


def unit_status(site: str, unit: str) -> str:
    """Key of a unit's state (message UnitStatus); answers a query with the last one."""
    return _key("unit_status", site=site, unit=unit)


def log(site: str, unit: str) -> str:
    """Key to query for records of a unit's log: ``{key}?from=N;max=M`` (message LogRecords)."""
    return _key("log", site=site, unit=unit)


def rpc(site: str, unit: str, command: str) -> str:
    """Key to query with a command to a unit (messages CommandRequest, CommandReply)."""
    return _key("rpc", site=site, unit=unit, command=command)


def alive(site: str, unit: str) -> str:
    """Liveliness token held by the gateway while it serves the unit."""
    return _key("alive", site=site, unit=unit)


def service_status(site: str, service: str) -> str:
    """Key of a service's state (message ServiceStatus)."""
    return _key("service_status", site=site, service=service)


def contour(site: str) -> str:
    """Key of a site's contour (message Contour); answers a query with the last one."""
    return _key("contour", site=site)


def features(site: str) -> str:
    """Key of a site's feature points (message Features); answers a query with the last ones."""
    return _key("features", site=site)


def grid(site: str, tile: str = ANY) -> str:
    """Key of one tile of a site's reliability grid (message GridTile), or of all; ``tile`` as made by tile_name()."""
    return _key("grid", site=site, tile=tile)


def tile_name(tile_x: int, tile_y: int) -> str:
    """Name of the grid tile at the given tile indices."""
    return f"{tile_x}_{tile_y}"


def schema(message: str) -> str:
    """Key that answers a query with the FileDescriptorSet of a message, given its full name (``noctule.v1.Sweep``)."""
    return _key("schema", message=message)


@dataclass(frozen=True)
class UnitKey:
    """A key below ``noctule/@v1/{site}/unit/{unit}``; ``subject`` is what follows."""

    site: str
    unit: str
    subject: str


def parse_unit(key: str) -> UnitKey:
    """Take a unit's key apart; raises KeyFormatError if it is not one."""
    match key.split("/"):
        case ["noctule", "@v1", site, "unit", unit, *subject] if subject:
            return UnitKey(name(site, "site"), name(unit, "unit"), "/".join(subject))
    raise KeyFormatError(f"{key!r} is not a unit's key: it should read {ROOT}/SITE/unit/UNIT/SUBJECT")


def _key(subject: str, **chunks: str) -> str:
    names = {what: _chunk(value, what) if what in _NAMES else value for what, value in chunks.items()}
    return f"{ROOT}/{SUBJECTS[subject].key.format_map(names)}"


def _chunk(value: str, what: str) -> str:
    return value if value == ANY else name(value, what)
