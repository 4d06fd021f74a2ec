"""Whether what was rendered is sound and still fits the fleet file: expiry, keys' permissions, generations, rules."""

from collections.abc import Iterator
from dataclasses import dataclass
from datetime import datetime
from enum import IntEnum
from pathlib import Path

from noctule import firmware_rules, operators, tls
from noctule.errors import TlsError
from noctule_deploy import authority, generations
from noctule_deploy.fleet import Fleet
from noctule_deploy.generations import common_name
from noctule_deploy.host_files import hosts
from noctule_deploy.render import Place, Wanted, host_tree, superfluous, wanted


class Severity(IntEnum):
    """How bad a finding is; the worst one is the command's exit status."""

    WRONG = 1
    EXPIRES = 3


@dataclass(frozen=True)
class Finding:
    """Something that an operator has to see to."""

    severity: Severity
    text: str


def check(fleet: Fleet, place: Place, now: datetime) -> list[Finding]:
    """All that is wrong, and what expires within 30 days. Raises RenderError where the generations can't be read."""
    known = generations.load(place.out)
    if not known and fleet.subjects():
        return [_wrong(f"nothing is rendered in {place.out} yet: run noctule-deploy render")]
    expected = generations.of_fleet(known, fleet.subjects())
    findings = list(_authority(place))
    if expected != known:
        changed = sorted(subject for subject in expected if expected[subject] != known.get(subject))
        findings.append(_wrong(f"names were added to or taken from the fleet file ({', '.join(changed)}): {_RENDER}"))
    for each in wanted(fleet, expected):
        findings += _folder(place.out / each.common_name, each, now)
    findings += _old_keys(place, fleet, expected)
    if not any(each.severity is Severity.WRONG for each in findings):  # the hosts' folders are made of those above
        findings += (each for host in hosts(fleet) for each in _host(fleet, host, place, expected))
    return findings


_RENDER = "run noctule-deploy render, copy the routers' folders to them and start them again"


def _authority(place: Place) -> Iterator[Finding]:
    key = place.ca / authority.KEY_FILE
    if key.exists():  # it may be kept elsewhere
        yield from _private(key)


def _folder(folder: Path, wanted: Wanted, now: datetime) -> Iterator[Finding]:
    if not folder.is_dir():
        yield _wrong(f"{folder} is not there: {_RENDER}")
        return
    try:
        identity = tls.load(folder, now)
    except TlsError as error:
        yield _wrong(str(error))
        return
    if alarm := identity.expiry_alarm(now):
        yield Finding(Severity.EXPIRES, alarm)
    if identity.common_name != wanted.common_name:
        yield _wrong(f"{folder} holds a certificate of {identity.common_name}, which is of another name: {_RENDER}")
    if (folder / tls.CONFIG).read_bytes() != wanted.config:
        yield _wrong(f"{folder / tls.CONFIG} does not fit the fleet file and its generations: {_RENDER}")
    for name, content in ((firmware_rules.FILE, wanted.firmware), (operators.FILE, wanted.operators)):
        path = folder / name
        if (path.read_bytes() if path.exists() else None) != content:
            yield _wrong(f"{path} does not fit the fleet file: run noctule-deploy render, copy the folder to its host")


def _host(fleet: Fleet, host: str, place: Place, known: dict[str, generations.Generations]) -> Iterator[Finding]:
    tree = host_tree(fleet, host, place, known)
    for each in tree:
        path = place.out / host / each.path
        if not path.is_file() or path.read_bytes() != each.content:
            yield _wrong(f"{path} does not fit the fleet file: run noctule-deploy render, copy the folder to its host")
        elif each.path.name == tls.PRIVATE_KEY:
            yield from _private(path)
    for path in superfluous(place.out / host, tree):
        yield _wrong(f"{path} is of no use to host {host}: run noctule-deploy render")


def _old_keys(place: Place, fleet: Fleet, known: dict[str, generations.Generations]) -> Iterator[Finding]:
    """Keys of generations that are admitted beside the newest must be as private as it."""
    for subject in fleet.subjects():
        for number in range(known[subject].oldest, known[subject].newest):
            key = place.out / common_name(subject, number) / tls.PRIVATE_KEY
            if key.exists():
                yield from _private(key)


def _private(path: Path) -> Iterator[Finding]:
    try:
        tls.check_private(path)
    except TlsError as error:
        yield _wrong(str(error))


def _wrong(text: str) -> Finding:
    return Finding(Severity.WRONG, text)
