"""The key scheme of the bus: every key is built and parsed here, never by hand.

    noctule/@v1/{site}/unit/{unit}/sweep | pose | status | @log | @rpc/{name} | @alive
    noctule/@v1/{site}/service/{name}/status
    noctule/@v1/{site}/map/contour | features | grid/{tile}
    noctule/@v1/@schema/{message}

Where a key is to match several, ANY stands for a name. A chunk that begins with ``@`` is verbatim in Zenoh: ``**`` does
not match it, so data never mixes with logs, commands or another major version.
"""

import re
from dataclasses import dataclass

from noctule.errors import KeyFormatError

ROOT = "noctule/@v1"
ANY = "*"
LONGEST_NAME = 64
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


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
    return _unit(site, unit, "sweep")


def pose(site: str, unit: str) -> str:
    """Key on which whoever tracks a moving unit publishes where it is (message Pose)."""
    return _unit(site, unit, "pose")


def unit_status(site: str, unit: str) -> str:
    """Key of a unit's state (message UnitStatus); answers a query with the last one."""
    return _unit(site, unit, "status")


def log(site: str, unit: str) -> str:
    """Key to query for records of a unit's log: ``{key}?from=N;max=M`` (message LogRecords)."""
    return _unit(site, unit, "@log")


def rpc(site: str, unit: str, command: str) -> str:
    """Key to query with a command to a unit (messages CommandRequest, CommandReply)."""
    return _unit(site, unit, f"@rpc/{_chunk(command, 'command')}")


def alive(site: str, unit: str) -> str:
    """Liveliness token held by the gateway while it serves the unit."""
    return _unit(site, unit, "@alive")


def service_status(site: str, service: str) -> str:
    """Key of a service's state (message ServiceStatus)."""
    return f"{ROOT}/{_chunk(site, 'site')}/service/{_chunk(service, 'service')}/status"


def contour(site: str) -> str:
    """Key of a site's contour (message Contour); answers a query with the last one."""
    return f"{ROOT}/{_chunk(site, 'site')}/map/contour"


def features(site: str) -> str:
    """Key of a site's feature points (message Features); answers a query with the last ones."""
    return f"{ROOT}/{_chunk(site, 'site')}/map/features"


def grid(site: str, tile: str = ANY) -> str:
    """Key of one tile of a site's reliability grid (message GridTile), or of all; ``tile`` as made by tile_name()."""
    return f"{ROOT}/{_chunk(site, 'site')}/map/grid/{tile}"


def tile_name(tile_x: int, tile_y: int) -> str:
    """Name of the grid tile at the given tile indices."""
    return f"{tile_x}_{tile_y}"


def schema(message: str) -> str:
    """Key that answers a query with the FileDescriptorSet of a message, given its full name (``noctule.v1.Sweep``)."""
    return f"{ROOT}/@schema/{message}"


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


def _unit(site: str, unit: str, subject: str) -> str:
    return f"{ROOT}/{_chunk(site, 'site')}/unit/{_chunk(unit, 'unit')}/{subject}"


def _chunk(value: str, what: str) -> str:
    return value if value == ANY else name(value, what)
