"""The fleet file: which routers, gateways, mappers, people and services there are, and what each is there for."""

import difflib
import ipaddress
import tomllib
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from noctule import firmware_rules, firmware_signature, keys
from noctule.errors import FirmwareKeyError, KeyFormatError
from noctule.firmware_rules import FirmwareRules
from noctule.keys import Role
from noctule_deploy.errors import FleetFileError

ROUTER = "router"
LONGEST_NAME = 40  # a certificate's common name has 64 characters: role, name and generation
_ALIKE = 0.7  # of difflib, as in the site file
_TOP = ["router", "gateway", "mapper", "operator", "viewer", "service"]


def _name(value: str) -> str:
    try:
        keys.name(value, "name")
    except KeyFormatError as error:
        raise ValueError("use lower-case letters, digits, '-' and '_'") from error
    if len(value) > LONGEST_NAME:
        raise ValueError(f"give at most {LONGEST_NAME} characters")
    return value


def _site(value: str) -> str:
    return value if value == keys.ANY else _name(value)


def _address(value: str) -> str:
    try:
        ipaddress.ip_address(value)
    except ValueError:
        if not value or any(letter.isspace() or letter in "/:#?" for letter in value):
            raise ValueError("give a host name or an IP address; the port is a key of its own") from None
    return value


def _version(value: str) -> str:
    try:
        firmware_rules.version(value)
    except FirmwareKeyError as error:
        raise ValueError("write a version as 0.9.0") from error
    return value


def _key(value: str) -> str:
    try:
        firmware_signature.public_key("", value)
    except FirmwareKeyError as error:
        raise ValueError("copy what noctule-deploy firmware-key printed") from error
    return value


Name = Annotated[str, AfterValidator(_name)]
Site = Annotated[str, AfterValidator(_site)]
Address = Annotated[str, AfterValidator(_address)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Router(_Table):
    """A router: where others reach it, and where it listens."""

    name: Name
    address: Address
    port: int = Field(default=7447, ge=1, le=65535)
    listen: Address = "0.0.0.0"


class Gateway(_Table):
    """A gateway: the units that it serves."""

    name: Name
    site: Name
    units: list[Name] = Field(min_length=1)


class Watcher(_Table):
    """A mapper, operator, viewer or service: the sites that it is for, or "*"."""

    name: Name
    sites: list[Site] = Field(min_length=1)


class Tracked(_Table):
    """A unit whose pose a service publishes."""

    site: Name
    unit: Name


class Service(Watcher):
    """An extra service."""

    tracks: list[Tracked] = []


class Firmware(_Table):
    """Which firmware images the gateways give to units: ``keys`` are public ones, by name."""

    oldest: Annotated[str, AfterValidator(_version)] = "0.0.0"
    keys: dict[Name, Annotated[str, AfterValidator(_key)]] = Field(min_length=1)

    def rules(self) -> FirmwareRules:
        """The same, as a gateway reads it."""
        keys = tuple(firmware_signature.public_key(name, text) for name, text in self.keys.items())
        return FirmwareRules(keys, firmware_rules.version(self.oldest))


class Member(BaseModel):
    """One who joins the bus as a client: ``units`` are those on whose keys it may publish, as (site, unit)."""

    model_config = ConfigDict(frozen=True)
    role: Role
    name: str
    sites: tuple[str, ...]
    units: tuple[tuple[str, str], ...]

    @property
    def subject(self) -> str:
        """The common name of its certificates, but for the generation."""
        return f"{self.role}.{self.name}"


class Fleet(_Table):
    """All of it."""

    folder: str = Field(default="/etc/noctule/bus", pattern="^/")
    valid_days: int = Field(default=730, ge=1, le=3650)
    firmware: Firmware | None = None
    router: list[Router] = Field(min_length=1)
    gateway: list[Gateway] = []
    mapper: list[Watcher] = []
    operator: list[Watcher] = []
    viewer: list[Watcher] = []
    service: list[Service] = []

    def members(self) -> Iterator[Member]:
        """All but the routers."""
        for each in self.gateway:
            units = tuple((each.site, unit) for unit in each.units)
            yield Member(role=Role.GATEWAY, name=each.name, sites=(each.site,), units=units)
        for role in (Role.MAPPER, Role.OPERATOR, Role.VIEWER):
            for each in getattr(self, role):
                yield Member(role=role, name=each.name, sites=tuple(each.sites), units=())
        for each in self.service:
            units = tuple((tracked.site, tracked.unit) for tracked in each.tracks)
            yield Member(role=Role.SERVICE, name=each.name, sites=tuple(each.sites), units=units)

    def subjects(self) -> list[str]:
        """The common names of all certificates, routers' too, but for the generation."""
        return [f"{ROUTER}.{each.name}" for each in self.router] + [member.subject for member in self.members()]


def load(path: Path) -> Fleet:
    """The fleet of a file. Raises FleetFileError."""
    try:
        entries = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        raise FleetFileError(f"{path} is not there: noctule-deploy init writes an example of one") from error
    except (OSError, UnicodeDecodeError) as error:
        raise FleetFileError(f"{path} can't be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise FleetFileError(f"{path} is not TOML: {error}") from error
    try:
        fleet = Fleet.model_validate(entries)
    except ValidationError as error:
        raise FleetFileError(f"{path}: " + "; ".join(_words(each, entries) for each in error.errors())) from error
    for problem in _contradictions(fleet):
        raise FleetFileError(f"{path}: {problem}")
    return fleet


def _contradictions(fleet: Fleet) -> Iterator[str]:
    """What each table may say but not all together."""
    names = Counter(each.name for kind in _TOP[1:] for each in getattr(fleet, kind))
    names_of_routers = Counter(each.name for each in fleet.router)
    for name, count in [*names.items(), *names_of_routers.items()]:
        if count > 1:
            yield f"name {name!r} is given {count} times: give each table a name of its own"
    served = Counter((each.site, unit) for each in fleet.gateway for unit in each.units)
    for (site, unit), count in served.items():
        if count > 1:
            yield f"unit {unit!r} of site {site!r} has {count} gateways: keep it with one"
    sites = {each.site for each in fleet.gateway}
    for kind in _TOP[2:]:
        for number, each in enumerate(getattr(fleet, kind), start=1):
            for site in each.sites:
                if site not in sites | {keys.ANY}:
                    yield f"[[{kind}]] {number}: sites has {site!r}, {_unserved(site, sites)}"
    for number, service in enumerate(fleet.service, start=1):
        for tracked in service.tracks:
            if (tracked.site, tracked.unit) not in served:
                units = {unit for site, unit in served if site == tracked.site}
                where = f"unit {tracked.unit!r} of site {tracked.site!r}"
                yield f"[[service]] {number}: tracks {where}, {_unserved(tracked.unit, units)}"


def _unserved(word: str, served: set[str]) -> str:
    return "which no gateway serves" + (_meant(word, served) or ": add it to a gateway, or correct it")


def _words(error: Any, entries: dict[str, Any]) -> str:
    """One of pydantic's findings as an operator reads it: table, key, what is wrong, what to do."""
    *above, key = error["loc"]
    table: Any = entries
    for step in above:
        table = table[step]
    if isinstance(key, int):  # an element of a list
        above, key = above[:-1], f"{above[-1]}[{key}]"
    models = {"gateway": Gateway, "router": Router, "service": Service, "firmware": Firmware}
    model = models.get(str(above[0]), Watcher) if above else Fleet
    where = _place([*above])
    match error["type"]:
        case "extra_forbidden":
            known = set(model.model_fields)
            hint = _meant(str(key), known) or f": correct or remove it (known: {', '.join(sorted(known))})"
            return f"{where}{key} is not known here{hint}"
        case "missing":
            near = difflib.get_close_matches(str(key), set(table) - set(model.model_fields), 1, _ALIKE)
            return f"{where}{key} is missing: add it" + (f" (did you write it as {near[0]}?)" if near else "")
        case "value_error":
            return f"{where}{key} is {error['input']!r}: {error['ctx']['error']}"
    return f"{where}{key} is {error['input']!r}: {error['msg'][0].lower()}{error['msg'][1:]}"


def _place(above: list[str | int]) -> str:
    match above:
        case []:
            return ""
        case [str(kind), int(index), *below]:
            return f"[[{kind}]] {index + 1}: " + "".join(f"{step}." for step in below if isinstance(step, str))
    return ".".join(map(str, above)) + ": "


def _meant(word: str, known: set[str]) -> str:
    near = difflib.get_close_matches(word, known, 1, _ALIKE)
    return f": did you mean {near[0]}?" if near else ""
