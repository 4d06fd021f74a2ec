"""The program that shares sites with others of its kind, and runs the mappers of those that fall to it."""

import threading
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import zenoh

from noctule import bounds, keys, logs
from noctule.errors import BoundsError
from noctule.folder_lock import FolderLock, Owner
from noctule.messages_pb2 import ServiceStatus
from noctule.systemd import ServiceManager
from noctule_mapper.live.service import LiveSettings, join
from noctule_mapper.sharing.offers import Offers
from noctule_mapper.sharing.rendezvous import owner_of
from noctule_mapper.sharing.site_process import SiteProcess, forking_context

_STEP_S = 0.2
_QUERY_TIMEOUT_S = 1.0


@dataclass(frozen=True)
class SharedSites:
    """The settings of each site that may fall to this mapper, alike but for the site and its folder in ``data``."""

    data: Path
    sites: Sequence[LiveSettings]
    log_format: logs.LogFormat


def run(shared: SharedSites, stop: threading.Event) -> None:
    """Share sites until ``stop`` is set, and end every mapper that this process has started.

    Raises FolderError, SharingError, KeyFormatError, BusConfigError.
    """
    sites = [keys.name(each.site, "site") for each in shared.sites]
    name = keys.name(shared.sites[0].service, "service name")
    context, manager = forking_context(), ServiceManager()
    with ExitStack() as closing:
        closing.enter_context(FolderLock(shared.data, Owner("mapper of several sites", "", name)))
        session = join(shared.sites[0], stop, manager)
        if session is None:
            return
        closing.callback(session.close)
        offers = Offers(session, name, sites, stop)
        closing.callback(offers.close)
        other_mapper = partial(mapper_of, session, but=name)
        mapped = [SiteProcess(each, shared.log_format, context, other_mapper) for each in shared.sites]
        closing.callback(_end, mapped)
        closing.callback(manager.stopping)
        while not stop.wait(_STEP_S):
            if offers.are_settled():
                for each in mapped:
                    each.step(mine=owner_of(each.site, offers.members(each.site)) == name)
            manager.serving(f"maps {sum(each.runs for each in mapped)} of {len(sites)} shared sites")


def mapper_of(session: zenoh.Session, site: str, but: str) -> str | None:
    """The name of a mapper other than ``but`` that maps ``site`` now; None where there is none."""
    for reply in session.get(keys.service_status(site, keys.ANY), timeout=_QUERY_TIMEOUT_S):
        if reply.ok is not None:
            try:
                status = bounds.decode(ServiceStatus, reply.ok.payload.to_bytes())
            except BoundsError:
                continue  # no mapper of ours
            if status.role == "mapper" and status.name != but:
                return status.name
    return None


def _end(mapped: Sequence[SiteProcess]) -> None:
    for each in mapped:
        each.end()
    for each in mapped:
        each.wait()
