"""The live mapper: has the logs of a site read, keeps its map, and shows it on the bus and to those who watch."""

import logging
import re
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import zenoh

from noctule import bounds, bus, keys, metrics, metrics_server, rerun_paths
from noctule.bus_watch import BusWatch
from noctule.client import Client
from noctule.errors import BoundsError, BusConfigError, BusError
from noctule.folder_lock import FolderLock, Owner
from noctule.log_follower import LogFollower
from noctule.messages_pb2 import Contour, ServiceStatus, UnitStatus
from noctule.rivals import Rivals
from noctule.systemd import ServiceManager
from noctule_mapper.contour.reasons import no_room
from noctule_mapper.live.config import LiveConfig, to_toml
from noctule_mapper.live.intake import SweepIntake
from noctule_mapper.live.map_messages import MapSettings, MapState
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.publish import MapPublisher
from noctule_mapper.live.remote_map import RemoteMap
from noctule_mapper.live.store import SweepStore
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.live.troubles import Troubles
from noctule_mapper.rerun_view.no_log import NoLog

if TYPE_CHECKING:
    from noctule_mapper.rerun_view.log import RerunLog

_log = logging.getLogger(__name__)

_STATUS_INTERVAL_S = 1.0
_JOIN_EVERY_S = 1.0
_MOST_NAMED = 5  # units
_LONGEST_DETAIL = bounds.text("ServiceStatus", "detail").longest


@dataclass(frozen=True)
class LiveSettings:
    """Where a live mapper works; ``rerun_url`` None means that nobody watches, ``metrics_at`` None no metrics.

    ``fit_turn`` is the file by which mappers take turns at fitting; None: this one fits when it likes. ``lease_s`` is
    the lease of its sessions, as in ``bus.open_session``. ``last_contour`` is the last contour that was published of
    the site, by another mapper or by this one before a restart, to be shown until one is fitted; empty for none.
    """

    site: str
    service: str
    data: Path
    connect: Sequence[str]
    rerun_url: str | None
    config: LiveConfig
    tls_folder: Path | None = None
    metrics_at: str | None = None
    fit_turn: Path | None = None
    lease_s: float | None = None
    last_contour: bytes = b""


def run(settings: LiveSettings, stop: threading.Event, nursery: Nursery) -> None:
    """Map until ``stop`` is set, with the map in a process of ``nursery``.

    Raises FolderError, StoreError, MetricsError, RelayAddressError, KeyFormatError.
    """
    owner = Owner("mapper", keys.name(settings.site, "site"), keys.name(settings.service, "service name"))
    manager, shown = ServiceManager(), _Shown(settings)
    with ExitStack() as closing:
        closing.enter_context(FolderLock(settings.data, owner))
        store = SweepStore(settings.data / f"{settings.site}.sqlite3", settings.config.window)
        closing.callback(store.close)
        log = _shown_on(settings.rerun_url, settings.site)
        closing.callback(log.close)
        closing.enter_context(metrics_server.serving(settings.metrics_at, metrics.registry(shown.statuses)))
        session = join(settings, stop, manager)
        if session is None:
            return
        closing.callback(session.close)
        client = closing.enter_context(Client(settings.site, session=session))
        mapper = LiveMapper(settings, store, log, client, nursery)
        closing.callback(mapper.close)
        closing.callback(manager.stopping)
        mapper.report()  # at once: mappers that share this site wait for it to be mapped
        mapper.start()
        shown.mapper = mapper
        (settings.data / f"{settings.site}.config.toml").write_text(to_toml(settings.config))
        while not stop.wait(_STATUS_INTERVAL_S):
            mapper.report()
            manager.serving(mapper.summary, mapper.makes_progress)


def _shown_on(url: str | None, site: str) -> "RerunLog | NoLog":
    if not url:
        return NoLog()
    from noctule_mapper.rerun_view.log import RerunLog  # Rerun's SDK takes half a second of the processor to import

    return RerunLog(url, site)


class _Shown:
    """What a scrape shows: before the mapper is on the bus no more than its version."""

    def __init__(self, settings: LiveSettings) -> None:
        self._settings = settings
        self.mapper: LiveMapper | None = None

    def statuses(self) -> Sequence[ServiceStatus | Contour]:
        return [_empty_status(self._settings)] if self.mapper is None else self.mapper.statuses()


class LiveMapper:
    """One site's mapper between its store, the bus and the viewers."""

    def __init__(
        self, settings: LiveSettings, store: SweepStore, log: "RerunLog | NoLog", client: Client, nursery: Nursery
    ) -> None:
        self._settings, self._store, self._log, self._client = settings, store, log, client
        self._publisher = MapPublisher(client.session, settings.site, settings.service)
        self._schemas = bus.declare_schemas(client.session)
        self._troubles = Troubles(log.show_event)
        self._intake = SweepIntake(settings.config, store, log, self._troubles, lambda *change: self._map.take(*change))
        self._map = RemoteMap(
            nursery,
            MapSettings(settings.config, settings.site, settings.service, settings.fit_turn),
            self._intake.held,
            self._show,
            self._intake.set_aside,
            self._troubles,
        )
        self._follower = LogFollower(client, self._intake.deliver, store.cursors())
        self._rivals = Rivals(
            client.session,
            keys.service_status(settings.site, keys.ANY),
            ServiceStatus,
            lambda status: status.name if status.role == "mapper" else "",
        )
        self._watch = BusWatch(client.session, settings.connect, tls_folder=settings.tls_folder)
        self._contour, self._inherited = Contour(), False  # whether it was there before this mapper fitted one
        self._latest = _empty_status(settings)

    def start(self) -> None:
        """Rebuild the map from the store, and go on from where it ends."""
        self._show_last()
        held = self._intake.recall()
        self._map.start(held)
        self._follower.start()
        if self._settings.rerun_url:  # else every status would be decoded for nobody
            self._client.on_unit_status(self._log.show_unit_status)
            self._client.on_alive(self._tell_alive)
        self._watch.begin(lambda: [self._publisher.status])
        self._log.show_event(f"mapper started with {len(held)} sweeps from its store")

    def report(self) -> None:
        """Publish how the mapper fares. Raises RuntimeError where the store is damaged."""
        self._map.watch()
        self._store.check()
        self._store.checkpoint()
        self._look_for_rivals()
        status = _empty_status(self._settings)
        status.counters.update(self.counters())
        status.cursors.extend(self._store.cursors().values())
        status.detail = self._detail()
        self._latest = status
        self._publisher.publish_status(status)
        self._log.show_service_status(status, summary(self._contour))

    def counters(self) -> dict[str, int]:
        """What became of sweeps, contours, and what was to be shown."""
        follower = {f"log_{name}": count for name, count in self._follower.counters().items()}
        bus_ = {f"bus_{name}": count for name, count in self._client.counters().items()}
        return self._intake.counters() | self._map.counters() | follower | bus_ | self._log.counters()

    def statuses(self) -> Sequence[ServiceStatus | Contour]:
        """The last status, and the contour if there is one. From any thread, never waiting."""
        return [self._latest, self._contour] if self._contour.version else [self._latest]

    @property
    def makes_progress(self) -> bool:
        """The map is not stuck on its way to those who see it."""
        return self._map.makes_progress

    @property
    def summary(self) -> str:
        """How the mapper fares, in a line."""
        return "; ".join(filter(None, (summary(self._contour), self._latest.detail)))

    def close(self) -> None:
        """Take in no more; what was taken in is in the store."""
        self._follower.close()
        self._map.close()
        self._watch.close()
        self._rivals.close()
        self._publisher.close()
        self._schemas.undeclare()

    def _look_for_rivals(self) -> None:
        if others := self._rivals.listed():
            self._troubles.begin("rivals", f"another mapper maps this site too ({others}): stop one of them")
        else:
            self._troubles.end("rivals", "no other mapper maps this site any more")

    def _detail(self) -> str:
        """What is wrong, and why there is no wall or not the whole grid, as long as a status may be."""
        off_grid = self._map.counters()["sweeps_off_grid"]
        parts = (
            self._watch.detail(),
            self._troubles.detail(),
            self._intake.detail(),
            unread_detail(self._follower.unread()),
            self._publisher.detail(),
            no_room(off_grid, self._settings.config.mapper.grid) if self._contour.walls else self._contour.note,
        )
        told = "; ".join(filter(None, parts))
        return told if len(told) <= _LONGEST_DETAIL else told[: _LONGEST_DETAIL - 3] + "..."

    def _show_last(self) -> None:
        """Show the last contour that was published of the site, under a number of this mapper."""
        if not self._settings.last_contour:
            return
        try:
            contour = bounds.decode(Contour, self._settings.last_contour)
            if contour.site != self._settings.site:
                _log.warning("the last contour of the site is not shown: it says that it is of site %r", contour.site)
                return
            contour.version = self._store.next_contour_version()
        except (BoundsError, StoreError) as error:
            _log.warning("the last contour of the site is not shown: %s", error)
            return
        _log.info("shows the last contour of the site (by mapper %r) until it has fitted one", contour.mapper)
        contour.mapper = self._settings.service
        self._publisher.publish_contour(contour)
        self._log.show_contour(contour)
        self._contour, self._inherited = contour, True

    def _show(self, state: MapState) -> None:
        """Number the state and show it. Raises StoreError where no number can be had."""
        if self._inherited and not state.contour.sweeps:
            return  # the logs are still to be read, and until then the inherited contour says more
        state.contour.version = state.features.version = self._store.next_contour_version()
        self._publisher.publish_map(state.contour, state.features, state.tiles)
        self._log.show_tiles(state.tiles)
        self._log.show_features(state.features)
        self._log.show_contour(state.contour)
        if _objects(state.contour) != _objects(self._contour):
            _log.info("%s", summary(state.contour))
            self._log.show_event(summary(state.contour))
        if _kind(state.contour.note) != _kind(self._contour.note):
            _log.info("%s", state.contour.note or "the contour lacks nothing")
            self._log.show_event(state.contour.note or "the contour lacks nothing")
        self._contour, self._inherited = state.contour, False

    def _tell_alive(self, unit: str, alive: bool) -> None:
        if alive:
            self._log.show_event(f"{unit} is served by a gateway")
        else:
            gone = UnitStatus(unit=unit, state=UnitStatus.STATE_DISCONNECTED, detail="no gateway serves it any more")
            self._log.show_unit_status(gone)


def _empty_status(settings: LiveSettings) -> ServiceStatus:
    """A status of now that says no more than who and of which version the mapper is."""
    status = ServiceStatus(site=settings.site, name=settings.service, role="mapper", version=version("noctule-mapper"))
    if settings.rerun_url is not None:
        status.rerun = version("rerun-sdk")
        status.rerun_recording = rerun_paths.recording(settings.rerun_url, settings.site)
    status.time.GetCurrentTime()
    return status


def join(settings: LiveSettings, stop: threading.Event, manager: ServiceManager) -> zenoh.Session | None:
    """A session on the bus, as soon as a router answers; None if ``stop`` is set before."""
    told = False
    while not stop.is_set():
        try:
            return bus.open_session(
                settings.connect, patience_s=0, tls_folder=settings.tls_folder, lease_s=settings.lease_s
            )
        except BusConfigError:
            raise
        except BusError as error:
            if not told:
                _log.warning("%s; waiting for it", error)
                told = True
            manager.waiting(str(error))
            stop.wait(_JOIN_EVERY_S)
    return None


def summary(contour: Contour) -> str:
    """A contour in a line: ``5 walls, 5 corners, 1 cylinder from 44 sweeps``."""
    counted = [f"{count} {noun}{'' if count == 1 else 's'}" for noun, count in _objects(contour).items()]
    return f"{', '.join(counted)} from {contour.sweeps} sweep{'' if contour.sweeps == 1 else 's'}"


def unread_detail(logs: Mapping[str, str]) -> str:
    """Which units' logs can't be read, and why the first of them; empty while all can."""
    if not logs:
        return ""
    units = [*list(logs)[:_MOST_NAMED], *(["..."] if len(logs) > _MOST_NAMED else [])]
    return f"the log of {', '.join(units)} can't be read: {next(iter(logs.values()))}"


def _kind(note: str) -> str:
    """A note without its numbers, which may change with every sweep."""
    return re.sub(r"\d+", "", note)


def _objects(contour: Contour) -> dict[str, int]:
    return {"wall": len(contour.walls), "corner": len(contour.corners), "cylinder": len(contour.cylinders)}
