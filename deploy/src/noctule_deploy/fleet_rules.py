"""What each table of a fleet may say, but not all of them together."""

import difflib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from noctule import keys
from noctule import site as sites
from noctule.errors import SiteFileError
from noctule.site import Site
from noctule.toml_lines import Place
from noctule_deploy import host_rules
from noctule_deploy.fleet import ROUTER, Fleet, Gateway

DEVICES = "/dev/noctule"  # the udev rules' names of the units' serial adapters
_ALIKE = 0.7
_MEMBERS = ("gateway", "mapper", "operator", "viewer", "service")


def mistakes(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    """Each with its place in the file."""
    yield from _names(fleet)
    yield from _units(fleet)
    yield from _sites(fleet)
    yield from _bus_names(fleet)
    yield from host_rules.mistakes(fleet)
    for number, gateway in enumerate(fleet.gateway):
        yield from _gateway(fleet, gateway, ("gateway", number))


def _names(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    for kinds in ((ROUTER,), _MEMBERS):
        places = [((kind, number, "name"), each.name) for kind in kinds for number, each in _numbered(fleet, kind)]
        counts = Counter(name for _, name in places)
        for place, name in places:
            if counts[name] > 1:
                yield place, f"name {name!r} is given {counts[name]} times: give each table a name of its own"


def _bus_names(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    """A gateway that is a router has the router's name on the bus, so no other member may have it."""
    own = {each.router: each.name for each in fleet.gateway if each.router}
    for kind in _MEMBERS:
        for number, each in _numbered(fleet, kind):
            if own.get(each.name, each.name) != each.name:
                problem = f"name {each.name!r} is that of the router which gateway {own[each.name]!r} is"
                yield (kind, number, "name"), f"{problem}: give this table another"


def _units(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    served = Counter((each.site, unit) for each in fleet.gateway for unit in each.units)
    for number, gateway in enumerate(fleet.gateway):
        for unit in dict.fromkeys(gateway.units):
            if (count := served[gateway.site, unit]) > 1:
                problem = f"unit {unit!r} of site {gateway.site!r} has {count} gateways: keep it with one"
                yield ("gateway", number, "units"), problem
    for number, service in enumerate(fleet.service):
        for tracked in service.tracks:
            if (tracked.site, tracked.unit) not in served:
                units = {unit for site, unit in served if site == tracked.site}
                where = f"unit {tracked.unit!r} of site {tracked.site!r}"
                yield ("service", number, "tracks"), f"tracks {where}, {_unserved(tracked.unit, units)}"


def _sites(fleet: Fleet) -> Iterator[tuple[Place, str]]:
    served = set(fleet.sites())
    for kind in _MEMBERS[1:]:
        for number, each in _numbered(fleet, kind):
            for site in each.sites:
                if site not in served | {keys.ANY}:
                    yield (kind, number, "sites"), f"sites has {site!r}, {_unserved(site, served)}"


def _gateway(fleet: Fleet, gateway: Gateway, place: Place) -> Iterator[tuple[Place, str]]:
    if strangers := set(gateway.adapters) - set(gateway.units):
        names = ", ".join(sorted(strangers))
        yield (
            (*place, "adapters"),
            f"adapters has {names}, which units does not have{_meant(min(strangers), gateway.units)}",
        )
    for adapter, count in Counter(gateway.adapters.values()).items():
        if count > 1:
            yield (*place, "adapters"), f"adapter {adapter!r} is given to {count} units: each has an adapter of its own"
    if gateway.router is not None:
        yield from _own_router(fleet, gateway, place)
    if gateway.site_file is not None:
        yield from _site_file(gateway, place)
    elif gateway.host is not None:
        yield (*place, "host"), "host is given and site_file is not: name the site file that this host gets"


def _own_router(fleet: Fleet, gateway: Gateway, place: Place) -> Iterator[tuple[Place, str]]:
    named = {each.name: each for each in fleet.router}
    router = named.get(gateway.router or "")
    if router is None:
        known = f"which is no [[router]]{_meant(gateway.router or '', named)}"
        yield (*place, "router"), f"router is {gateway.router!r}, {known}"
    elif router.host is not None:
        yield (
            (*place, "router"),
            f"router {router.name!r} runs on host {router.host!r} by itself: remove one of the two",
        )
    elif [each.router for each in fleet.gateway].count(router.name) > 1:
        yield (*place, "router"), f"router {router.name!r} is given to several gateways: only one can be it"


def _site_file(gateway: Gateway, place: Place) -> Iterator[tuple[Place, str]]:
    try:
        site = sites.load(Path(gateway.site_file or ""))
    except SiteFileError as error:
        for mistake in str(error).splitlines():
            yield (*place, "site_file"), f"site_file has a mistake: {mistake}"
        return
    if site.name != gateway.site:
        yield (*place, "site"), f"site is {gateway.site!r}, and {gateway.site_file} is of site {site.name!r}"
    written = {unit.name for unit in site.units}
    if written != set(gateway.units):
        both = f"{', '.join(sorted(gateway.units))}, and {gateway.site_file} has {', '.join(sorted(written))}"
        yield (*place, "units"), f"units has {both}: a gateway serves all units of its site file"
    yield from _addresses(gateway, site, place)


def _addresses(gateway: Gateway, site: Site, place: Place) -> Iterator[tuple[Place, str]]:
    for unit in site.units:
        device = f"{DEVICES}/{unit.name}"
        if unit.name in gateway.adapters and unit.address != device:
            problem = f"adapters names unit {unit.name} {device}, and {gateway.site_file} has {unit.address!r}"
            yield (*place, "adapters"), f"{problem}: write address = {device!r} there"
        elif unit.address.startswith(f"{DEVICES}/") and unit.name not in gateway.adapters:
            problem = f"{gateway.site_file} has {unit.address}, for which adapters has no serial number"
            yield (*place, "adapters"), f'{problem}: add {unit.name} = "..."'


def _numbered(fleet: Fleet, kind: str) -> Iterator[tuple[int, Any]]:
    yield from enumerate(getattr(fleet, kind))


def _unserved(word: str, served: Iterable[str]) -> str:
    return "which no gateway serves" + (_meant(word, served) or ": add it to a gateway, or correct it")


def _meant(word: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(word, list(known), 1, _ALIKE)
    return f": did you mean {near[0]}?" if near else ""
