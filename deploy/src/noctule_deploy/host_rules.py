"""What the programs of a host need of each other: ports of their own, sites to read, a viewer that shows the map."""

import re
from collections import Counter
from collections.abc import Iterator

from noctule import keys
from noctule.toml_lines import Place
from noctule_deploy.fleet import ROUTER, Fleet
from noctule_deploy.hosts import programs, shows, sites_of

_FOLDER = r"/etc/noctule(/[A-Za-z0-9_-][A-Za-z0-9._-]*)*"


def mistakes(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    """Each with its place in the file."""
    yield from _folder(fleet)
    yield from _ports(fleet)
    yield from _pages(fleet)
    yield from _sites(fleet)
    yield from _mappers(fleet)


def _folder(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    # Services can't read people's homes, and containers get this folder only.
    if any(programs(fleet)) and not re.fullmatch(_FOLDER, fleet.folder):
        said = "the hosts' programs read /etc/noctule only: give a folder there, without blanks"
        yield ("folder",), f"folder is {fleet.folder!r}: {said}"


def _ports(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    taken: dict[tuple[str, int], tuple[Place, str]] = {}
    for host, port, place, owner in _listeners(fleet):
        before, holder = taken.setdefault((host, port), (place, owner))
        if before != place:
            key, other = (".".join(map(str, each[2:])) for each in (place, before))
            yield place, f"{key} is {port}, which {holder} of the same host has as its {other}: give another"


def _listeners(fleet: Fleet) -> Iterator[tuple[str, int, Place, str]]:
    """Each port with its host; a program without one is alone on its own."""
    for number, each in enumerate(fleet.router):
        by_gateway = next((gateway.host for gateway in fleet.gateway if gateway.router == each.name), None)
        host = each.host or by_gateway or f"{ROUTER} {number}"
        yield host, each.port, (ROUTER, number, "port"), f"{ROUTER} {each.name!r}"
    for number, each in enumerate(fleet.viewer):
        host, owner = each.host or f"viewer {number}", f"viewer {each.name!r}"
        yield host, each.port, ("viewer", number, "port"), owner
        yield host, each.web_port, ("viewer", number, "web_port"), owner
        if each.web:
            yield host, each.web.port, ("viewer", number, "web", "port"), owner


def _pages(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    web = [(number, each) for number, each in enumerate(fleet.viewer) if each.web and each.host]
    hosts = Counter(each.host for _, each in web)
    for number, each in web:
        if hosts[each.host] > 1:
            yield (
                ("viewer", number, "web"),
                f"host {each.host!r} has {hosts[each.host]} pages: put one of them elsewhere",
            )


def _sites(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    for kind, watchers in (("mapper", fleet.mapper), ("viewer", fleet.viewer)):
        for number, each in enumerate(watchers):
            if each.host and not sites_of(fleet, each):
                yield (
                    (kind, number, "sites"),
                    f'sites has "{keys.ANY}", and no gateway serves a site: add a [[gateway]]',
                )


def _mappers(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    for number, mapper in enumerate(fleet.mapper):
        if any(each.split("=")[0] == "--rerun" for each in mapper.options):
            continue  # it draws elsewhere, or nowhere
        beside = [each for each in fleet.viewer if mapper.host and each.host == mapper.host]
        if beside and not any(shows(fleet, each, mapper) for each in beside):
            names = ", ".join(each.name for each in beside)
            problem = (
                f"no viewer of host {mapper.host!r} ({names}) has all sites of this mapper, so none shows its maps"
            )
            yield ("mapper", number, "sites"), f"{problem}: add them to a viewer, or give the mapper another host"
