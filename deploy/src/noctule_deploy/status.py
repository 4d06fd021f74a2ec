"""How the programs of a fleet fare, by what they say on the bus: one row for each, with its certificate's expiry."""

from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum
from functools import partial
from pathlib import Path

from noctule import bus, keys, tls
from noctule.client import Client
from noctule.errors import BusError
from noctule.keys import Role
from noctule.messages_pb2 import ServiceStatus
from noctule_deploy import pages, zenoh_config
from noctule_deploy.errors import RenderError
from noctule_deploy.fleet import ROUTER, Fleet, Member
from noctule_deploy.generations import Generations, common_name
from noctule_deploy.hosts import WEB, programs
from noctule_deploy.render import Place

_PATIENCE_S = 3.0
_OLD = timedelta(seconds=15)  # a program says each second how it fares; clocks of hosts may differ by some seconds
_WITHOUT_STATUS = (Role.OPERATOR,)


class State(StrEnum):
    """How a program fares."""

    WELL = "well"
    EXPIRES = "expires"  # well, but its certificate expires within 30 days
    ALARM = "alarm"  # it says that something is wrong
    OLD = "old"  # its last word is old: it hangs, or its network is cut
    AWAY = "away"


@dataclass(frozen=True)
class Row:
    """One program. ``expires`` is None where its certificate was not rendered here."""

    host: str
    program: str
    site: str
    state: State
    version: str
    expires: datetime | None
    detail: str


@dataclass(frozen=True)
class Heard:
    """What answers: the routers, by name; the statuses of all services; and by its viewer's name what is wrong with
    each page, empty where nothing is.
    """

    routers: frozenset[str]
    services: tuple[ServiceStatus, ...]
    pages: Mapping[str, str]


def listen(fleet: Fleet, tls_folder: Path) -> Heard:
    """Ask every router and every page whether it answers, and every site for its services. Raises BusError where no
    router does.
    """
    with ThreadPoolExecutor() as pool:  # at once: what hangs lets each question run out of time
        answers = list(pool.map(partial(_answers, tls_folder), map(zenoh_config.endpoint, fleet.router)))
        routers = frozenset(each.name for each, answer in zip(fleet.router, answers, strict=True) if answer)
        with bus.closing(bus.open_session(patience_s=_PATIENCE_S, tls_folder=tls_folder)) as session:

            def of_site(site: str) -> list[ServiceStatus]:
                with Client(site, session=session, tls_folder=tls_folder) as client:
                    try:
                        return client.service_statuses()
                    except BusError:  # the only one who could reply hangs, which its row shows
                        return []

            asked = {each.name: pool.submit(pages.trouble, each.web) for each in fleet.viewer if each.host and each.web}
            found = list(pool.map(of_site, fleet.sites()))
            troubles = {name: told.result() for name, told in asked.items()}
    return Heard(routers, tuple(status for statuses in found for status in statuses), troubles)


def own_folder(fleet: Fleet, place: Place, known: Mapping[str, Generations]) -> Path:
    """The rendered folder of an operator who may read all sites. Raises RenderError."""
    for each in fleet.operator:
        if keys.ANY in each.sites or set(each.sites) >= set(fleet.sites()):
            subject = f"{Role.OPERATOR}.{each.name}"
            if subject in known:
                return place.out / common_name(subject, known[subject].newest)
    if not known:
        raise RenderError(f"{place.out} has no certificates yet: run noctule-deploy render, or name a folder (--tls)")
    raise RenderError(f"{place.out} has no operator who may read all sites: name a certificate's folder (--tls)")


def expiries(fleet: Fleet, place: Place, known: Mapping[str, Generations]) -> dict[str, datetime]:
    """When the certificates that were rendered here last expire, by subject."""
    folders = {each: place.out / common_name(each, known[each].newest) for each in fleet.subjects() if each in known}
    return {
        subject: tls.read_certificate(folder / tls.CERTIFICATE).not_valid_after_utc
        for subject, folder in folders.items()
        if (folder / tls.CERTIFICATE).is_file()
    }


def rows(fleet: Fleet, heard: Heard, expiries: Mapping[str, datetime], now: datetime) -> list[Row]:
    """A row for each program of the fleet, those without a host at the end; one for each site that a mapper has."""
    running = {(each.role, each.name): each for each in programs(fleet)}
    hosts = {each.subject: each.host for each in running.values()}
    found: list[Row] = []
    for router in fleet.router:
        subject = f"{ROUTER}.{router.name}"
        up = router.name in heard.routers
        state = _with_expiry(State.WELL if up else State.AWAY, expiries.get(subject), now)
        detail = "" if up else "no answer, or it refuses this certificate"
        found.append(Row(hosts.get(subject, ""), subject, "", state, "", expiries.get(subject), detail))
    for member in fleet.members():
        if member.role not in _WITHOUT_STATUS:
            program = running.get((member.role, member.name))
            subject = program.subject if program and program.subject else member.subject
            said = _said(member, subject, heard.services)
            found += _of_member(member, hosts.get(subject, ""), said, expiries.get(subject), now)
    for viewer, trouble in heard.pages.items():
        state = State.AWAY if trouble else State.WELL
        found.append(Row(running[WEB, viewer].host, f"{WEB}.{viewer}", "", state, "", None, trouble))
    return sorted(found, key=lambda row: (not row.host, row.host))


def _answers(tls_folder: Path, endpoint: str) -> bool:
    try:
        with bus.closing(bus.open_session([endpoint], patience_s=_PATIENCE_S, tls_folder=tls_folder)):
            return True
    except BusError:
        return False


def _said(member: Member, subject: str, services: Iterable[ServiceStatus]) -> list[ServiceStatus]:
    """What a member says on its sites. Its name on the bus is the one in its certificate."""
    name = subject.partition(".")[2]
    sites = set(member.sites)
    return [each for each in services if each.name == name and (keys.ANY in sites or each.site in sites)]


def _of_member(
    member: Member, host: str, said: list[ServiceStatus], expires: datetime | None, now: datetime
) -> list[Row]:
    if not said:
        state = _with_expiry(State.AWAY, expires, now)
        several = len(member.sites) > 1 or keys.ANY in member.sites
        detail = "says nothing on any of its sites" if several else "says nothing"
        return [Row(host, member.subject, ", ".join(member.sites), state, "", expires, detail)]
    return [
        Row(
            host,
            member.subject,
            each.site,
            _with_expiry(_state(each, now), expires, now),
            each.version,
            expires,
            each.detail,
        )
        for each in said
    ]


def _state(status: ServiceStatus, now: datetime) -> State:
    if now - status.time.ToDatetime(now.tzinfo) > _OLD:
        return State.OLD
    return State.ALARM if status.detail else State.WELL


def _with_expiry(state: State, expires: datetime | None, now: datetime) -> State:
    soon = expires is not None and expires - now <= tls.ALARM
    return State.EXPIRES if state is State.WELL and soon else state
