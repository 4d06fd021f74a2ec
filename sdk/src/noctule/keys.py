"""The key scheme of the bus: every key is built and parsed here, never by hand.

SUBJECTS is the table of all keys. Where a key is to match several, ANY stands for a name. A chunk that begins with
``@`` is verbatim in Zenoh: ``**`` does not match it, so data never mixes with logs, commands or another major version.
"""

import re
from dataclasses import dataclass
from enum import StrEnum

from noctule.errors import KeyFormatError

ROOT = "noctule/@v1"
ANY = "*"
LONGEST_NAME = 64
_NAMES = ("site", "unit", "service", "command")  # chunks that only a name() may fill
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")


class Role(StrEnum):
    """What a program or a person on the bus is there for; a router's rules go by it."""

    GATEWAY = "gateway"
    MAPPER = "mapper"
    OPERATOR = "operator"
    VIEWER = "viewer"
    SERVICE = "service"


class Carrier(StrEnum):
    """How a subject travels."""

    DATA = "published"
    STATE = "published, and a query gets the last one"
    ANSWER = "the answer to a query"
    TOKEN = "a liveliness token"


@dataclass(frozen=True)
class Subject:
    """What one kind of key carries, and who may publish and read it.

    ``key`` follows ROOT, with the names that vary in braces. ``message`` is the full name of what is published, or of
    the reply where the key is queried; empty where the key alone says it. ``publisher`` is who publishes it in words,
    ``publishers`` are their roles: each for its own units, for itself, or for its sites, as ``key`` has a unit, a
    service or only a site. A service publishes poses of the units that it tracks.
    """

    key: str
    message: str
    publisher: str
    meaning: str
    carrier: Carrier
    publishers: frozenset[Role]
    readers: frozenset[Role]

    def of(self, **names: str) -> str:
        """The key of the given site, unit and so on, with ANY for those that are not given."""
        values = {chunk: names.get(chunk, ANY) for chunk in self.chunks()}
        checked = {chunk: _chunk(value, chunk) if chunk in _NAMES else value for chunk, value in values.items()}
        return f"{ROOT}/{self.key.format_map(checked)}"

    def chunks(self) -> list[str]:
        """What varies in the key: ``site``, ``unit``."""
        return re.findall(r"{(\w+)}", self.key)


_GATEWAY, _MAPPER, _SERVICE = frozenset({Role.GATEWAY}), frozenset({Role.MAPPER}), frozenset({Role.SERVICE})
_OPERATOR = frozenset({Role.OPERATOR})
_ALL = frozenset(Role)
_WATCHERS = _ALL - _GATEWAY
_PROGRAMS = _ALL - _OPERATOR  # operators come and go, and show no status

SUBJECTS = {
    "sweep": Subject(
        *("{site}/unit/{unit}/sweep", "noctule.v1.Sweep", "gateway", "a sweep, once it is in the log"),
        *(Carrier.DATA, _GATEWAY, _WATCHERS),
    ),
    "pose": Subject(
        *("{site}/unit/{unit}/pose", "noctule.v1.Pose", "tracker", "where a moving unit is"),
        *(Carrier.DATA, _SERVICE, _ALL),
    ),
    "unit_status": Subject(
        *("{site}/unit/{unit}/status", "noctule.v1.UnitStatus", "gateway", "a unit's state"),
        *(Carrier.STATE, _GATEWAY, _ALL),
    ),
    "log": Subject(
        *("{site}/unit/{unit}/@log", "noctule.v1.LogRecords", "gateway", "a unit's log: ?from=N;max=M"),
        *(Carrier.ANSWER, _GATEWAY, _WATCHERS),
    ),
    "rpc": Subject(
        *("{site}/unit/{unit}/@rpc/{command}", "noctule.v1.CommandReply", "gateway", "a unit's commands"),
        *(Carrier.ANSWER, _GATEWAY, _OPERATOR),
    ),
    "alive": Subject(
        *("{site}/unit/{unit}/@alive", "", "gateway", "a liveliness token while it serves the unit"),
        *(Carrier.TOKEN, _GATEWAY, _ALL),
    ),
    "service_status": Subject(
        *("{site}/service/{service}/status", "noctule.v1.ServiceStatus", "each service", "a service's state"),
        *(Carrier.STATE, _PROGRAMS, _ALL),
    ),
    "offer": Subject(
        *("{site}/service/{service}/@offer", "", "mapper", "a liveliness token while it would map the site"),
        *(Carrier.TOKEN, _MAPPER, _ALL),
    ),
    "contour": Subject(
        *("{site}/map/contour", "noctule.v1.Contour", "mapper", "the site's contour"),
        *(Carrier.STATE, _MAPPER, _WATCHERS),
    ),
    "features": Subject(
        *("{site}/map/features", "noctule.v1.Features", "mapper", "the site's feature points"),
        *(Carrier.STATE, _MAPPER, _WATCHERS),
    ),
    "grid": Subject(
        *("{site}/map/grid/{tile}", "noctule.v1.GridTile", "mapper", "one tile of the reliability grid"),
        *(Carrier.STATE, _MAPPER, _WATCHERS),
    ),
    "schema": Subject(
        *("@schema/{message}", "google.protobuf.FileDescriptorSet", "gateway, mapper", "how a message is laid out"),
        *(Carrier.ANSWER, _GATEWAY | _MAPPER, _ALL),
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
    """Key on which a tracker publishes where a moving unit is (message Pose)."""
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


def offer(site: str, service: str) -> str:
    """Liveliness token held by a mapper that shares the site with others and is ready to map it."""
    return _key("offer", site=site, service=service)


def of_all(key: str) -> str:
    """The expression by which others read a unit's or service's ``key``: the same with ANY for its name."""
    match key.split("/"):
        case ["noctule", "@v1", site, "unit" | "service" as kind, _, *subject]:
            return "/".join((ROOT, site, kind, ANY, *subject))
    return key


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


def parse_offer(key: str) -> tuple[str, str]:
    """Site and mapper of an offer's key; raises KeyFormatError if it is not one."""
    match key.split("/"):
        case ["noctule", "@v1", site, "service", service, "@offer"]:
            return name(site, "site"), name(service, "service name")
    raise KeyFormatError(f"{key!r} is not an offer's key: it should read {ROOT}/SITE/service/MAPPER/@offer")


def parse_service_status(key: str) -> tuple[str, str]:
    """Site and service of the key of a service's status; raises KeyFormatError if it is not one."""
    match key.split("/"):
        case ["noctule", "@v1", site, "service", service, "status"]:
            return name(site, "site"), name(service, "service name")
    raise KeyFormatError(f"{key!r} is no service status's key: it should read {ROOT}/SITE/service/NAME/status")


def parse_rpc(key: str) -> str:
    """The command of a key of one unit and one command; raises KeyFormatError for any other, wildcards too."""
    parsed = parse_unit(key)
    match parsed.subject.split("/"):
        case ["@rpc", command]:
            return name(command, "command")
    raise KeyFormatError(f"{key!r} is not a command's key: it should read {ROOT}/SITE/unit/UNIT/@rpc/COMMAND")


def _key(subject: str, **chunks: str) -> str:
    return SUBJECTS[subject].of(**chunks)


def _chunk(value: str, what: str) -> str:
    return value if value == ANY else name(value, what)
