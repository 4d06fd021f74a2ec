"""Whether a service's way over the bus is open, because Zenoh drops what a router forbids and says nothing.

What the service publishes is read back over a second connection, as a reader would get it. That is done after each
connection to a router and every ten minutes, and takes a second or two; in between there is no second connection.
"""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic

import zenoh

from noctule import bus, bus_config, endpoints, keys, reachability, tls
from noctule.bus import StatePublisher
from noctule.endpoint_watch import EndpointWatch
from noctule.errors import BusError
from noctule.expiry_watch import ExpiryWatch

LOOK_EVERY_S = 0.5
# Looks are counted and not timed: a process that is held up by its own work has not waited.
_LOOKS, _LOOKS_FOR_ONE = 60, 30
AGAIN_S, AGAIN_WHILE_WRONG_S = 600.0, 20.0
LOST_AFTER_S = 3.0  # a router that is started again is back by then
_COMPARE_EVERY_S = 0.1  # so that no state that is published each second is passed over
_LISTED = 5

_log = logging.getLogger(__name__)


class BusWatch:
    """Watches the session of a service from begin() to close(); detail() is for the service's status.

    ``connect``, ``listen`` and ``tls_folder`` are what the session was opened with. Where the service is the router
    itself, only its endpoints and the certificate's expiry are watched.
    """

    def __init__(
        self,
        session: zenoh.Session,
        connect: Sequence[str] = (),
        listen: Sequence[str] = (),
        tls_folder: Path | None = None,
    ) -> None:
        """Raises BusConfigError."""
        self._session = session
        self._identity = tls.chosen(tls_folder)
        config = bus_config.config(connect, listen, self._identity)
        self._routers = bus_config.endpoints_of(config, "connect")
        self._is_router = bus_config.is_router(config)
        listen_on = bus_config.endpoints_of(config, "listen") if self._is_router else []
        self._endpoints = EndpointWatch(self._routers, listen_on, self._is_router)
        self._open_to_all = bus_config.open_to_all(config) if self._is_router else ""
        self._publishers: Callable[[], Sequence[StatePublisher]] = tuple
        self._expiry = ExpiryWatch(self._identity)
        self._trouble = ""
        self._said: set[str] = set()  # all that it was since all was well
        self.looked = threading.Event()  # set once the way was looked at
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus watch", daemon=True)

    def begin(self, publishers: Callable[[], Sequence[StatePublisher]]) -> None:
        """Watch what ``publishers`` gives: the states that the service publishes each second or so."""
        self._publishers = publishers
        self._endpoints.begin()
        if not self._is_router:
            self._thread.start()

    def detail(self) -> str:
        """What is wrong, a router that is open to all, and a certificate that expires soon, in words; empty while all
        is well.
        """
        alarm = self._expiry.look(datetime.now(UTC))
        return "; ".join(filter(None, (self._trouble, self._endpoints.detail(), self._open_to_all, alarm)))

    def close(self) -> None:
        """Watch no more."""
        self._closed.set()
        self._endpoints.close()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        checked: tuple[frozenset[str], frozenset[str]] = frozenset(), frozenset()
        due_s, seen_s = 0.0, monotonic()
        while not self._closed.wait(LOOK_EVERY_S):
            routers = frozenset(str(zid) for zid in self._session.info.routers_zid())
            now_s = monotonic()
            if routers:
                seen_s = now_s
            elif now_s - seen_s < LOST_AFTER_S:
                continue
            present = routers, frozenset(each.key for each in self._publishers() if each.last is not None)
            if present == checked and now_s < due_s:
                continue
            found = self._read_back() if routers else self._no_router()
            if found is None:
                continue
            self._tell(found)
            self.looked.set()
            checked = present
            due_s = monotonic() + (AGAIN_WHILE_WRONG_S if self._trouble else AGAIN_S)

    def _no_router(self) -> str:
        return f"the connection is lost: {reachability.why_no_router(self._routers, self._identity)}"

    def _read_back(self) -> str | None:
        """Read what is published, as others do; what is wrong, or empty; None where that can't be said yet."""
        try:
            with bus.open_session(
                self._routers, patience_s=2.0, tls_folder=self._identity.folder if self._identity else None
            ) as reader:
                missing = self._unread(reader)
        except (BusError, zenoh.ZError) as error:
            return f"whether others read what is published is not known, because a second connection failed: {error}"
        if not missing:
            return None if missing is None else ""
        more = f" and {len(missing) - _LISTED} more" if len(missing) > _LISTED else ""
        return f"nobody reads what is published on {', '.join(missing[:_LISTED])}{more}: {self._likely_cause()}"

    def _unread(self, reader: zenoh.Session) -> list[str] | None:
        """The keys on which something was published and did not come back; None where too little was to say."""
        publishers = {each.key: each for each in self._publishers() if each.last is not None}
        before = {key: each.last for key, each in publishers.items()}
        published: dict[str, set[int]] = {key: set() for key in publishers}  # hashes
        read: set[str] = set()

        def note(sample: zenoh.Sample) -> None:
            """Keep nothing of the sample, because others may flood the key. It may come before ``published`` has it."""
            key, state = str(sample.key_expr), sample.payload.to_bytes()
            if key in publishers and (state == publishers[key].last or hash(state) in published[key]):
                read.add(key)

        for expression in sorted({keys.of_all(key) for key in publishers}):
            reader.declare_subscriber(expression, note)
        waited: Counter[str] = Counter()
        for _ in range(_LOOKS):
            unread = publishers.keys() - read.copy()
            for key in unread:
                last = publishers[key].last
                if last is not None and last != before[key]:  # what was put before the reader came says nothing
                    published[key].add(hash(last))
                    waited[key] += 1
            if all(waited[key] > _LOOKS_FOR_ONE for key in unread) or self._closed.wait(_COMPARE_EVERY_S):
                break
        unread = publishers.keys() - read.copy()
        missing = sorted(key for key in unread if waited[key] > _LOOKS_FOR_ONE)
        return missing if missing or not unread else None

    def _likely_cause(self) -> str:
        at = f"the router at {endpoints.shown(self._routers)}"
        if self._identity is None:
            return f"the rules of {at} forbid it"
        name = self._identity.common_name
        return (
            f"the rules of {at} don't allow it to {name}. Either this certificate was revoked, or the fleet file has "
            "another site, other units or another name for it, or the router was not started again after a change"
        )

    def _tell(self, trouble: str) -> None:
        if trouble and trouble not in self._said:
            _log.warning("%s", trouble)
        elif self._trouble and not trouble:
            _log.info("what is published is read again")
        self._said = self._said | {trouble} if trouble else set()
        self._trouble = trouble
