"""The fleet: which routers, gateways, mappers, people and services there are, and what each is there for.

``host`` names the machine that runs a program: noctule-deploy renders a folder for each. A program without one is
installed by hand.
"""

import ipaddress
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo

from noctule import firmware_rules, firmware_signature, keys
from noctule.errors import FirmwareKeyError, KeyFormatError
from noctule.firmware_rules import FirmwareRules
from noctule.keys import Role

ROUTER = "router"
LONGEST_NAME = 40  # a certificate's common name has 64 characters: role, name and generation
LEAST_MEMORY_MB = 8  # of a relay, as noctule_viewer has it, which need not be installed where fleets are rendered
OWN_FOLDERS = ("ca",)  # what render makes beside the hosts' folders


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


def _host(value: str) -> str:
    if value in OWN_FOLDERS:
        raise ValueError("name the host otherwise: the authority's folder has this name")
    return _name(value)


def _file(value: str, info: ValidationInfo) -> str:
    """A file's path is relative to the fleet file."""
    path = Path(info.context or ".") / value
    if not path.is_file():
        raise ValueError(f"{path} is not there: a path is relative to the fleet file")
    return str(path)


def _adapter(value: str) -> str:
    if not re.fullmatch(r"[\w.:+-]+", value):
        raise ValueError("copy ID_SERIAL_SHORT of udevadm info --name /dev/ttyUSB0")
    return value


def _hashed(value: str) -> str:
    if not re.fullmatch(r"\$2[aby]\$\d\d\$[./A-Za-z0-9]{53}", value):
        raise ValueError("write the hash of a password, as caddy hash-password prints it")
    return value


def _port(value: int) -> int:
    if not 1 <= value <= 65535:
        raise ValueError("give a port from 1 to 65535")
    return value


def _memory(value: str) -> str:
    match = re.fullmatch(r"(\d+)(MB|GB)", value)
    if match is None or int(match[1]) * (1000 if match[2] == "GB" else 1) < LEAST_MEMORY_MB:
        raise ValueError(f"write it as 64MB or 1GB; a relay needs {LEAST_MEMORY_MB}MB to keep a map")
    return value


def bracketed(address: str) -> str:
    """An address as it stands before a port."""
    return f"[{address}]" if ":" in address else address


def _option(value: str) -> str:
    if not value or any(ord(letter) < 32 for letter in value):
        raise ValueError("write each word of the command line as an element of its own")
    return value


Name = Annotated[str, AfterValidator(_name)]
Site = Annotated[str, AfterValidator(_site)]
Address = Annotated[str, AfterValidator(_address)]
Host = Annotated[str, AfterValidator(_host)]
SiteFile = Annotated[str, AfterValidator(_file)]
Adapter = Annotated[str, AfterValidator(_adapter)]
PasswordHash = Annotated[str, AfterValidator(_hashed)]
Options = list[Annotated[str, AfterValidator(_option)]]
Port = Annotated[int, AfterValidator(_port)]


class _Table(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Router(_Table):
    """A router: where others reach it, and where it listens. ``host`` runs zenohd; without one, a gateway may be it."""

    name: Name
    address: Address
    port: Port = 7447
    listen: Address = "0.0.0.0"
    host: Host | None = None


class Gateway(_Table):
    """A gateway: the units that it serves, and by which USB serial adapter (its serial number) each is connected.

    ``router`` names the router that this gateway is itself, in a small site without zenohd.
    """

    name: Name
    site: Name
    units: list[Name] = Field(min_length=1)
    host: Host | None = None
    site_file: SiteFile | None = None
    adapters: dict[Name, Adapter] = {}
    router: Name | None = None
    options: Options = []


class Watcher(_Table):
    """An operator: the sites that it is for, or "*"."""

    name: Name
    sites: list[Site] = Field(min_length=1)


class Mapper(Watcher):
    """A mapper of one site, or one of those that share several."""

    host: Host | None = None
    options: Options = []


class Web(_Table):
    """The page behind Caddy: its name, who may log in (a bcrypt hash each), and who vouches for its certificate."""

    name: Address
    port: Port = 443
    certificate: Literal["internal", "acme"] = "internal"
    users: dict[Name, PasswordHash] = Field(min_length=1)


class Viewer(Watcher):
    """A relay for those who watch; on loopback, behind Caddy where it has a ``web`` table."""

    host: Host | None = None
    port: Port = 9876
    web_port: Port = 9090
    memory_limit: Annotated[str, AfterValidator(_memory)] = "64MB"
    web: Web | None = None
    options: Options = []


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
    mapper: list[Mapper] = []
    operator: list[Watcher] = []
    viewer: list[Viewer] = []
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

    def sites(self) -> list[str]:
        """The sites that gateways serve, in their order."""
        return list(dict.fromkeys(each.site for each in self.gateway))
