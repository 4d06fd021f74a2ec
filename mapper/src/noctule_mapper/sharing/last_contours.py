"""The last contour of each shared site, by any mapper: the next one shows it until it has fitted its own."""

from collections.abc import Iterable
from functools import partial

import zenoh

from noctule import keys
from noctule.bounds.table import PAYLOAD_BYTES

_LONGEST = PAYLOAD_BYTES["Contour"]
_QUERY_TIMEOUT_S = 5.0


class LastContours:
    """Listens from its making until close()."""

    def __init__(self, session: zenoh.Session, sites: Iterable[str]) -> None:
        self._last = dict[str, bytes]()
        self._subscribers = list[zenoh.Subscriber[None]]()
        for site in sites:
            key, note = keys.contour(site), partial(self._note, site)
            self._subscribers.append(session.declare_subscriber(key, note))
            session.get(key, partial(self._note_present, site), timeout=_QUERY_TIMEOUT_S)

    def of(self, site: str) -> bytes:
        """The site's last contour as it came, decoded by who needs it; empty where none has come."""
        return self._last.get(site, b"")

    def close(self) -> None:
        """Listen no more."""
        for subscriber in self._subscribers:
            subscriber.undeclare()

    def _note(self, site: str, sample: zenoh.Sample) -> None:
        if len(payload := sample.payload.to_bytes()) <= _LONGEST:
            self._last[site] = payload

    def _note_present(self, site: str, reply: zenoh.Reply) -> None:
        if reply.ok is not None and site not in self._last:  # else a newer one has come meanwhile
            self._note(site, reply.ok)
