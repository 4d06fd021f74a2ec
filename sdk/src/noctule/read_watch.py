"""Whether a program that only reads can read its site, because routers hide what a certificate may not read.

Zenoh says nothing of it: a forbidden subscription just stays empty, and so does that of a site whose gateway is down.
"""

import logging
import threading
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import zenoh

from noctule import bus_config, endpoints, reachability, tls
from noctule.client import Client
from noctule.errors import BusError
from noctule.expiry_watch import ExpiryWatch

LOOK_EVERY_S = 2.0
_LOOKS = 3  # that find something wrong, before it is said: a gateway may just be starting
_LISTED = 5

_log = logging.getLogger(__name__)


class ReadWatch:
    """Looks every 2 s whether a site's logs can be read, from begin() to close(), and logs it when that changes; and
    each day that the certificate expires soon.

    ``connect`` and ``tls_folder`` are what the client's session was opened with.
    """

    def __init__(self, client: Client, connect: Sequence[str] = (), tls_folder: Path | None = None) -> None:
        """Raises BusConfigError, TlsError."""
        self._client = client
        self._identity = tls.chosen(tls_folder)
        self._routers = bus_config.endpoints_of(bus_config.config(connect, (), self._identity), "connect")
        self._readable: set[str] = set()
        self.trouble = ""
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="read watch", daemon=True)

    def begin(self) -> None:
        """Watch."""
        self._thread.start()

    def close(self) -> None:
        """Watch no more."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join(LOOK_EVERY_S)  # a gateway may not answer

    def _run(self) -> None:
        in_a_row, expiry = 0, ExpiryWatch(self._identity)
        while not self._closed.wait(LOOK_EVERY_S):
            expiry.look(datetime.now(UTC))
            try:
                found = self._look()
            except (BusError, zenoh.ZError):
                continue  # a gateway that does not answer: the reader of the logs says so itself
            in_a_row = in_a_row + 1 if found else 0
            if not found or in_a_row >= _LOOKS:
                self._tell(found)

    def _look(self) -> str:
        """What is wrong, in words; empty where nothing is."""
        if not list(self._client.session.info.routers_zid()):
            return f"the connection is lost: {reachability.why_no_router(self._routers, self._identity)}"
        units = self._client.units()
        if not units:
            unseen = f"no unit of site {self._client.site!r} is seen"
            return f"{unseen}: either no gateway of it is up, or {self._forbidden()}"
        self._readable &= units
        # A log that was read once is not asked for again: rules change only when a router is started again.
        self._readable |= {
            unit for unit in sorted(units - self._readable) if self._client.unsifted_log(unit, 1, max=1) is not None
        }
        hidden = sorted(units - self._readable)
        if not hidden:
            return ""
        more = f" and {len(hidden) - _LISTED} more" if len(hidden) > _LISTED else ""
        return f"the logs of {', '.join(hidden[:_LISTED])}{more} can't be read: {self._forbidden()}"

    def _forbidden(self) -> str:
        at = f"the router at {endpoints.shown(self._routers)}"
        if self._identity is None:
            return f"the rules of {at} forbid it"
        return (
            f"the rules of {at} don't allow it to {self._identity.common_name}: this certificate was revoked, or the "
            "fleet file has another site for it"
        )

    def _tell(self, trouble: str) -> None:
        if trouble and trouble != self.trouble:
            _log.warning("%s", trouble)
        elif self.trouble and not trouble:
            _log.warning("site %r is read again", self._client.site)
        self.trouble = trouble
