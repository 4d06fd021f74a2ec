"""Which mappers are ready to map which sites: a liveliness token for each site and mapper, theirs and this one's.

A token goes with its mapper: at once where its connection closes, after Zenoh's lease where its host is cut off.
"""

import threading
import time
from collections import defaultdict
from collections.abc import Sequence

import zenoh

from noctule import keys
from noctule.errors import KeyFormatError
from noctule_mapper.sharing.errors import SharingError

_SETTLED_AFTER_S = 1.0  # several mappers come or go together
GHOST_GOES_WITHIN_S = 15.0  # the token of one that was cut off: Zenoh's lease is 10 s
_ASK_AGAIN_S = 0.5
_QUERY_TIMEOUT_S = 1.0


class Offers:
    """Offers ``sites`` under ``name`` from its making until close()."""

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        sites: Sequence[str],
        stop: threading.Event,
        ghost_goes_within_s: float = GHOST_GOES_WITHIN_S,
    ) -> None:
        """Waits for an offer of the same name to go, at most so long or until ``stop`` is set.

        Raises SharingError where it stays: two of one name would both take themselves for the owner of a site.
        """
        self._name = name
        self._lock = threading.Lock()
        self._members: defaultdict[str, set[str]] = defaultdict(set)
        self._changed_at_s = time.monotonic()
        self._refuse_twin(session, sites, stop, time.monotonic() + ghost_goes_within_s)
        liveliness = session.liveliness()
        self._tokens = [liveliness.declare_token(keys.offer(site, name)) for site in sites]
        # A router's rules let a mapper watch its own sites only, so no expression may stand for them all.
        self._watches = [
            liveliness.declare_subscriber(keys.offer(site, keys.ANY), self._note, history=True) for site in sites
        ]

    def members(self, site: str) -> frozenset[str]:
        """The mappers that are ready to map ``site``, this one among them."""
        with self._lock:
            return frozenset(self._members[site] | {self._name})

    def are_settled(self) -> bool:
        """No mapper has come or gone for a second."""
        return time.monotonic() >= self._changed_at_s + _SETTLED_AFTER_S

    def close(self) -> None:
        """Offer nothing any more."""
        for each in (*self._watches, *self._tokens):
            each.undeclare()

    def _refuse_twin(self, session: zenoh.Session, sites: Sequence[str], stop: threading.Event, until_s: float) -> None:
        while taken := [site for site in sites if _is_offered(session, site, self._name)]:
            if time.monotonic() > until_s:
                raise SharingError(
                    f"another mapper named {self._name!r} shares site {taken[0]!r}: stop it, or give this one a --name"
                )
            if stop.wait(_ASK_AGAIN_S):
                return

    def _note(self, sample: zenoh.Sample) -> None:
        try:
            site, member = keys.parse_offer(str(sample.key_expr))
        except KeyFormatError:
            return  # no mapper of ours
        with self._lock:
            if sample.kind == zenoh.SampleKind.PUT:
                self._members[site].add(member)
            else:
                self._members[site].discard(member)
        self._changed_at_s = time.monotonic()


def _is_offered(session: zenoh.Session, site: str, name: str) -> bool:
    replies = session.liveliness().get(keys.offer(site, name), timeout=_QUERY_TIMEOUT_S)
    return any(reply.ok is not None for reply in replies)
