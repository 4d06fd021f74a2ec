"""Everything that a fleet needs: a folder for each certificate and each host. What is right already is left alone."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

from cryptography import x509

from noctule import firmware_rules, operators, tls
from noctule.keys import ANY, Role
from noctule_deploy import authority, generations, zenoh_config
from noctule_deploy.errors import RenderError
from noctule_deploy.files import make_private_folder, write_atomically
from noctule_deploy.fleet import ROUTER, Fleet
from noctule_deploy.generations import Generations, common_name
from noctule_deploy.host_files import HostFile, host_files, hosts
from noctule_deploy.hosts import certificate_folder


@dataclass(frozen=True)
class Place:
    """Where a fleet is rendered: ``out`` has a folder for each certificate and host, ``ca`` the authority's key."""

    out: Path
    ca: Path


@dataclass(frozen=True)
class Wanted:
    """The folder of a name's newest certificate, as it should be."""

    common_name: str
    addresses: tuple[str, ...]
    config: bytes
    firmware: bytes | None  # the rules for firmware images; None where the folder has none
    operators: bytes | None  # whose commands are taken; None where the folder has no such list


def render(fleet: Fleet, place: Place, now: datetime) -> list[Path]:
    """Make what is missing or has changed, and return the folders that were touched. Raises RenderError, TlsError."""
    known = generations.of_fleet(generations.load(place.out), fleet.subjects())
    return _write(fleet, place, known, now)


def renew(fleet: Fleet, place: Place, subject: str, now: datetime) -> list[Path]:
    """The same, with a new certificate for ``subject``; the one before stays admitted. Raises RenderError, TlsError."""
    known = _known(fleet, place, subject)
    return _write(fleet, place, known | {subject: known[subject].renewed()}, now)


def revoke(fleet: Fleet, place: Place, subject: str, now: datetime) -> list[Path]:
    """The same, and no certificate that ``subject`` had is admitted any more. Raises RenderError, TlsError."""
    known = _known(fleet, place, subject)
    return _write(fleet, place, known | {subject: known[subject].revoked()}, now)


def wanted(fleet: Fleet, known: dict[str, Generations]) -> Iterator[Wanted]:
    """What render() makes, routers first."""
    firmware = firmware_rules.to_toml(fleet.firmware.rules()).encode() if fleet.firmware else None
    for each in fleet.router:
        subject = f"{ROUTER}.{each.name}"
        config = as_json(zenoh_config.router(fleet, each, known, certificate_folder(fleet, subject)))
        # A gateway of a small site is its own router.
        everybody = _operators(fleet, known, {ANY})
        yield Wanted(common_name(subject, known[subject].newest), (each.address,), config, firmware, everybody)
    for member in fleet.members():
        config = as_json(zenoh_config.client(fleet, certificate_folder(fleet, member.subject)))
        name = common_name(member.subject, known[member.subject].newest)
        if member.role is Role.GATEWAY:
            yield Wanted(name, (), config, firmware, _operators(fleet, known, {ANY, *member.sites}))
        else:
            yield Wanted(name, (), config, None, None)


def _operators(fleet: Fleet, known: dict[str, Generations], sites: set[str]) -> bytes:
    """The certificates of operators that are admitted at one of ``sites``; at ANY are all of them."""
    names = (
        name
        for member in fleet.members()
        if member.role is Role.OPERATOR and (sites == {ANY} or not sites.isdisjoint(member.sites))
        for name in known[member.subject].admitted(member.subject)
    )
    return operators.to_json(names).encode()


def as_json(config: dict[str, Any]) -> bytes:
    """A configuration as it stands in a file."""
    return (json.dumps(config, indent=1) + "\n").encode()


def _known(fleet: Fleet, place: Place, subject: str) -> dict[str, Generations]:
    known = generations.load(place.out)
    if subject not in fleet.subjects():
        raise RenderError(f"{subject!r} is no name of this fleet; names are {', '.join(fleet.subjects())}")
    if subject not in known:
        raise RenderError(f"{subject!r} has no certificate in {place.out} yet: run noctule-deploy render")
    return generations.of_fleet(known, fleet.subjects())


def _write(fleet: Fleet, place: Place, known: dict[str, Generations], now: datetime) -> list[Path]:
    if known and any(place.out.glob(f"*/{tls.CERTIFICATE}")) and not (place.ca / authority.CERTIFICATE_FILE).exists():
        raise RenderError(
            f"{place.ca} has no authority, and {place.out} has certificates of one: name its folder (--ca)"
        )
    make_private_folder(place.out)
    issuer = authority.open_or_create(place.ca, now)
    generations.save(place.out, known)  # first: a revocation holds whatever comes after
    valid = timedelta(days=fleet.valid_days)
    touched = [
        place.out / each.common_name for each in wanted(fleet, known) if _write_one(each, place, issuer, now, valid)
    ]
    return touched + [place.out / host for host in hosts(fleet) if _write_host(fleet, host, place, known)]


def host_tree(fleet: Fleet, host: str, place: Place, known: dict[str, Generations]) -> list[HostFile]:
    """The files of a host with what the folders of its certificates hold. Raises OSError."""
    folders = {each: place.out / common_name(each, known[each].newest) for each in fleet.subjects()}
    return host_files(fleet, host, folders)


def superfluous(folder: Path, tree: list[HostFile]) -> list[Path]:
    """Files of an earlier rendering in a host's folder, which must not reach the host."""
    wanted = {folder / each.path for each in tree}
    return [each for each in sorted((folder / "etc").rglob("*")) if each.is_file() and each not in wanted]


def _write_host(fleet: Fleet, host: str, place: Place, known: dict[str, Generations]) -> bool:
    folder = place.out / host
    make_private_folder(folder)
    tree = host_tree(fleet, host, place, known)
    touched = False
    for each in tree:
        path = folder / each.path
        make_private_folder(path.parent)
        touched |= write_atomically(path, each.content, each.mode)
    for each in superfluous(folder, tree):
        each.unlink()
        touched = True
    return touched


def _write_one(wanted: Wanted, place: Place, issuer: authority.Authority, now: datetime, valid: timedelta) -> bool:
    folder = place.out / wanted.common_name
    make_private_folder(folder)
    touched = write_atomically(folder / tls.AUTHORITY, authority.pem(issuer.certificate))
    key = authority.ensure_key(folder / tls.PRIVATE_KEY)
    if not _is_for(folder / tls.CERTIFICATE, wanted):
        certificate = issuer.issue(wanted.common_name, wanted.addresses, key, now, valid)
        touched |= write_atomically(folder / tls.CERTIFICATE, authority.pem(certificate))
    touched |= write_atomically(folder / tls.CONFIG, wanted.config)
    touched |= _write_or_remove(folder / firmware_rules.FILE, wanted.firmware)
    return _write_or_remove(folder / operators.FILE, wanted.operators) or touched


def _write_or_remove(path: Path, content: bytes | None) -> bool:
    if content is not None:
        return write_atomically(path, content)
    was_there = path.exists()
    path.unlink(missing_ok=True)
    return was_there


def _is_for(path: Path, wanted: Wanted) -> bool:
    """Whether the certificate is there and good for the addresses; a router that has moved needs another."""
    if not path.exists():
        return False
    present = tls.read_certificate(path).extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return present == authority.alternative_names(wanted.common_name, wanted.addresses)
