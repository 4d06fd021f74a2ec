"""The relay on the bus of a site: its status each second, whether others can read it, and what the site says.

The relay itself needs no bus, so it does not wait for one: all of this is on a thread of its own.
"""

import logging
import threading
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Self

import zenoh

from noctule import bus, bus_config, keys, tls
from noctule.bus_watch import BusWatch
from noctule.client import Client
from noctule.errors import NoctuleError
from noctule.messages_pb2 import ServiceStatus
from noctule_viewer import rerun_versions
from noctule_viewer.board.site_state import SiteState

_PUBLISH_EVERY_S = 1.0
_END_WITHIN_S = 2.0
_GONE_AFTER_S = 60.0

_log = logging.getLogger(__name__)


class _ClosedError(Exception):
    """close() was called while the session waited for a router."""


class Presence:
    """Publishes what put() was given last as the status of ``site``'s service of this viewer's name.

    Used as a context manager, or until close(). The name is the certificate's, or "viewer".
    """

    def __init__(
        self,
        site: str,
        state: SiteState,
        connect: Sequence[str] = (),
        tls_folder: Path | None = None,
        recording_id: str | None = None,
    ) -> None:
        """``state`` is given what the site says; ``recording_id`` is what the page shows, the site's if left out.

        Raises KeyFormatError, BusConfigError, TlsError.
        """
        self._recording_id = recording_id or site
        self._state = state
        self._site, self._connect, self._tls_folder = keys.name(site, "site"), connect, tls_folder
        self._name = tls.service_name(tls_folder, "viewer")
        bus_config.config(connect, (), tls.chosen(tls_folder))  # a mistake in it is told at once
        self._latest: ServiceStatus | None = None
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="presence", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def put(self, status: ServiceStatus) -> None:
        """Publish ``status`` soon; site, name and what is wrong with the way over the bus are added. Never waits."""
        self._latest = status

    def close(self) -> None:
        """Leave the bus."""
        self._closed.set()
        self._thread.join(_END_WITHIN_S)

    def _run(self) -> None:
        try:
            with (
                bus.closing(
                    bus.open_session(self._connect, tls_folder=self._tls_folder, while_waiting=self._end_where_closed)
                ) as session,
                Client(self._site, session=session) as client,
            ):
                self._publish(session, client)
        except _ClosedError:
            pass
        except (NoctuleError, zenoh.ZError) as error:
            _log.error("the viewer is not shown on the bus: %s", error)
            self._state.note_own_trouble(f"the viewer is not on the bus: {error}")

    def _publish(self, session: zenoh.Session, client: Client) -> None:
        publisher = bus.StatePublisher(session, keys.service_status(self._site, self._name), ServiceStatus)
        watch = BusWatch(session, self._connect, tls_folder=self._tls_folder)
        watch.begin(lambda: [publisher])
        try:
            self._listen(client)
            while not self._closed.wait(_PUBLISH_EVERY_S):
                status = self._latest
                trouble = "; ".join(filter(None, (self._trouble(watch), status.detail if status else "")))
                self._state.note_own_trouble(trouble)
                if status is not None:
                    message = ServiceStatus()
                    message.CopyFrom(status)
                    message.site, message.name = self._site, self._name
                    message.detail = trouble
                    publisher.put(message)
        finally:
            watch.close()
            publisher.close()

    def _trouble(self, watch: BusWatch) -> str:
        """What is wrong with the way over the bus, or with those who draw."""
        heard = self._state.heard()
        present = [each for name, each in heard.services.items() if heard.service_silent_s[name] < _GONE_AFTER_S]
        drawn = (
            rerun_versions.trouble(version("rerun-sdk"), present),
            rerun_versions.elsewhere(self._recording_id, present),
        )
        return "; ".join(filter(None, (watch.detail(), *drawn)))

    def _listen(self, client: Client) -> None:
        client.on_alive(self._state.note_alive)
        client.on_unit_status(self._state.note_unit)
        client.on_service_status(self._state.note_service)
        client.on_sweep(self._state.note_sweep)
        client.on_contour(self._state.note_contour)

    def _end_where_closed(self) -> None:
        if self._closed.is_set():
            raise _ClosedError
