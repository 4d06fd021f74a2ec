"""The program that shares sites with others of its kind, and runs the mappers of those that fall to it."""

import os
import threading
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import zenoh

from noctule import bounds, keys, logs, metrics, metrics_server
from noctule.ending import close_within_s
from noctule.errors import BoundsError
from noctule.folder_lock import FolderLock, Owner
from noctule.messages_pb2 import ServiceStatus
from noctule.systemd import ServiceManager
from noctule_mapper.live import fit_turn
from noctule_mapper.live.service import LiveSettings, join
from noctule_mapper.sharing.last_contours import LastContours
from noctule_mapper.sharing.offers import Offers
from noctule_mapper.sharing.rendezvous import owner_of
from noctule_mapper.sharing.shown import Shown
from noctule_mapper.sharing.site_process import SILENCE, SiteProcess, forking_context
from noctule_mapper.sharing.unshared import UnsharedSites

_STEP_S = 0.2
_STARTS_AT_ONCE = 8
_QUERY_TIMEOUT_S = 1.0
# Of a mapper that is stopped or lost its host the sites move after this. Zenoh sends a sign of life four times in it.
LEASE_S = 3.0
_OWN_END_S = 1.0  # of the time to close, for what this process has open itself


@dataclass(frozen=True)
class SharedSites:
    """The settings of each site that may fall to this mapper, alike but for the site and its folder in ``data``.

    ``metrics_at`` is where the figures of all of them are served; None for nowhere.
    """

    data: Path
    sites: Sequence[LiveSettings]
    log_format: logs.LogFormat
    metrics_at: str | None = None


def run(shared: SharedSites, stop: threading.Event) -> None:
    """Share sites until ``stop`` is set, and end every mapper that this process has started.

    Raises FolderError, SharingError, KeyFormatError, BusConfigError, MetricsError.
    """
    settings = site_settings(shared)
    name = keys.name(settings[0].service, "service name")
    context, manager, shown = forking_context(), ServiceManager(), Shown(name)
    with ExitStack() as closing:
        closing.enter_context(FolderLock(shared.data, Owner("mapper of several sites", "", name)))
        figures = metrics.registry(shown.statuses, sites=shown.pids)
        closing.enter_context(metrics_server.serving(shared.metrics_at, figures))
        session = join(settings[0], stop, manager)
        if session is None:
            return
        closing.callback(session.close)
        offers = Offers(session, name, [each.site for each in settings], stop)
        closing.callback(offers.close)
        closing.callback(shown.close)
        contours = LastContours(session, [each.site for each in settings])
        closing.callback(contours.close)
        mapped = [SiteProcess(each, shared.log_format, context, last_contour=contours.of) for each in settings]
        starts = closing.enter_context(ThreadPoolExecutor(_STARTS_AT_ONCE, thread_name_prefix="start"))
        closing.callback(_end, mapped)
        closing.callback(manager.stopping)
        unshared = UnsharedSites()
        while not stop.wait(_STEP_S):
            left_out = offers.let_in()
            if offers.are_settled():
                _step(mapped, offers, session, name, starts, shared.data)
            if offers.are_quiet():
                unshared.note(offers.unshared())
            pids = {each.site: each.pid for each in mapped if each.pid is not None}
            if shared.metrics_at is not None:
                shown.note(_counters(mapped, unshared), pids)
                shown.follow(session, pids)
            maps = f"maps {len(pids)} of {len(mapped)} shared sites"
            manager.serving("; ".join(filter(None, (maps, unshared.detail, left_out))))


def site_settings(shared: SharedSites) -> list[LiveSettings]:
    """The settings of each site's mapper, of whose sessions a silent one is soon known to be gone. They have as many
    turns at fitting among them as half the processors of this host.

    Raises KeyFormatError.
    """
    turns = max(1, (os.cpu_count() or 1) // 2)
    return [
        replace(
            each,
            site=keys.name(each.site, "site"),
            fit_turn=shared.data / f"fit-turn-{number % turns}",
            lease_s=LEASE_S,
        )
        for number, each in enumerate(shared.sites)
    ]


def _counters(mapped: Sequence[SiteProcess], unshared: UnsharedSites) -> dict[str, int]:
    return {
        "sites": len(mapped),
        "sites_mapped": sum(each.pid is not None for each in mapped),
        "sites_unshared": unshared.sites,
        "mappers_failed": sum(each.failed for each in mapped),
    }


def _step(
    mapped: Sequence[SiteProcess], offers: Offers, session: zenoh.Session, name: str, starts: Executor, data: Path
) -> None:
    """Start what is to start, several at a time, and end what is to end. Sites that are taken over go before fits."""
    now_s = time.monotonic()
    mine = {each.site: owner_of(each.site, offers.members(each.site)) == name for each in mapped}
    due = [each.site for each in mapped if each.is_due(mine[each.site], now_s)]
    others = other_mappers(session, due, but=name)
    # Sites of others are asked for again and again, and one that fails starts again and again.
    if any(each.site in due and each.site not in others and not each.restarts for each in mapped):
        fit_turn.pause(data)

    def step(each: SiteProcess) -> None:
        each.step(mine[each.site], others.get(each.site), now_s)

    for each in mapped:
        if each.site not in due:
            step(each)
    # A start goes to and fro between processes, and on a busy host each of them waits for its turn.
    list(starts.map(step, (each for each in mapped if each.site in due)))


def other_mappers(session: zenoh.Session, sites: Sequence[str], but: str) -> dict[str, str]:
    """Of those ``sites`` that a mapper other than ``but`` maps now: that mapper's name; SILENCE where one may,
    because somebody did not answer in time.

    All are asked before the first answer is awaited: where a mapper is cut off, each question takes its time-out.
    """
    asked = [(site, session.get(keys.service_status(site, keys.ANY), timeout=_QUERY_TIMEOUT_S)) for site in sites]
    names = {site: _mapper_among(replies, but) for site, replies in asked}
    return {site: name for site, name in names.items() if name is not None}


def _mapper_among(replies: Iterable[zenoh.Reply], but: str) -> str | None:
    silent = None
    for reply in replies:
        if reply.ok is not None:
            try:
                status = bounds.decode(ServiceStatus, reply.ok.payload.to_bytes())
            except BoundsError:
                continue  # no mapper of ours
            if status.role == "mapper" and status.name != but:
                return status.name
        else:
            silent = SILENCE
    return silent


def _end(mapped: Sequence[SiteProcess]) -> None:
    until_s = time.monotonic() + max(_OWN_END_S, close_within_s() - _OWN_END_S)
    for each in mapped:
        each.end()
    for each in mapped:
        each.wait(until_s)
