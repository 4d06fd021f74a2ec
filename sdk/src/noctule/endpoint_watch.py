"""Which endpoints of a session are dead: routers that do not answer, and own addresses that are not there yet."""

import logging
import threading
from collections.abc import Sequence

from noctule import endpoints, own_addresses, reachability

EVERY_S, EVERY_WHILE_WRONG_S = 60.0, 2.0

_log = logging.getLogger(__name__)


class EndpointWatch:
    """Looks at the endpoints of a session from begin() to close(), on a thread of its own.

    A router needs all of ``connect``. A client needs one, so the others are only named while one answers.
    """

    def __init__(self, connect: Sequence[str], listen: Sequence[str], is_router: bool) -> None:
        self._connect, self._listen, self._is_router = connect, listen, is_router
        self._faults: dict[str, str] = {}  # by endpoint, as shown
        self._said: dict[str, set[str]] = {}  # of those: all that it was in this outage
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="endpoint watch", daemon=True)

    def begin(self) -> None:
        """Begin to look."""
        self._thread.start()

    def detail(self) -> str:
        """What is wrong, in words; empty while all is well."""
        return "; ".join(self._faults.values())

    def close(self) -> None:
        """Look no more. A look that waits for a name server is left to its end."""
        self._closed.set()

    def _run(self) -> None:
        while not self._closed.is_set():
            self._tell(self._look())
            self._closed.wait(EVERY_WHILE_WRONG_S if self._faults else EVERY_S)

    def _look(self) -> dict[str, str]:
        faults = {endpoints.shown([each]): reachability.unreachable(each) for each in self._connect}
        dead = {shown: reason for shown, reason in faults.items() if reason}
        if not self._is_router and len(dead) == len(faults):
            dead = {}  # then the session is lost, and BusWatch says so
        found = {shown: f"router {shown}: {reason}; start it, or name another" for shown, reason in dead.items()}
        for each in self._listen:
            if own_addresses.is_missing(each):
                shown = endpoints.shown([each])
                found[shown] = f"not listening on {shown}: this host does not have that address yet"
        return found

    def _tell(self, faults: dict[str, str]) -> None:
        for shown, fault in faults.items():
            said = self._said.setdefault(shown, set())
            if fault not in said:  # a host that is off has two faults in turn: no answer, and no route
                _log.warning("%s", fault)
            said.add(fault)
        for shown in self._faults.keys() - faults.keys():
            _log.info("%s: all is well", shown)
            del self._said[shown]
        self._faults = faults
