"""Which mappers are ready to map which sites: a liveliness token for each site and mapper, theirs and this one's.

A token goes with its mapper: at once where its connection closes, after the session's lease where its host is cut off.
"""

import logging
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from queue import SimpleQueue

import zenoh

from noctule import keys
from noctule.errors import KeyFormatError
from noctule_mapper.sharing.errors import SharingError

SETTLED_AFTER_S = 1.0  # since one came: others may come with it, and each takes sites
# Since one went. All its tokens go in one moment, and a mapper that goes next takes no site from those that stay.
GONE_AFTER_S = 0.2
GHOST_GOES_WITHIN_S = 15.0  # the token of one that was cut off; of an earlier version, with Zenoh's lease of 10 s, too
_MOST_MAPPERS = 256  # of a site: on an open bus somebody could make up any number
_ASK_AGAIN_S = 0.5
_QUERY_TIMEOUT_S = 1.0

_log = logging.getLogger(__name__)


class Offers:
    """Offers ``sites`` under ``name`` from its making until close()."""

    def __init__(
        self,
        session: zenoh.Session,
        name: str,
        sites: Sequence[str],
        stop: threading.Event,
        ghost_goes_within_s: float = GHOST_GOES_WITHIN_S,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Waits for an offer of the same name to go, at most so long or until ``stop`` is set.

        Raises SharingError where it stays: two of one name would both take themselves for the owner of a site.
        """
        self._name, self._sites = name, list(sites)
        self._lock = threading.Lock()
        self._session, self._now = session, now
        self._members: defaultdict[str, set[str]] = defaultdict(set)
        self._left_out = dict[str, str]()  # by site, the first mapper that found no room among its members
        self._gone = set[tuple[str, str]]()  # tokens that went since all were asked for, or that of one left out
        self._told = ""
        self._settled_at_s = self._quiet_at_s = 0.0
        self._wait(SETTLED_AFTER_S)
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
        """No mapper has come for a second, and none has gone for GONE_AFTER_S.

        Without a router they are not: all the others seem to have gone.
        """
        if not _is_connected(self._session):
            self._wait(SETTLED_AFTER_S)  # the tokens come again after the connection
        return self._now() >= self._settled_at_s

    def are_quiet(self) -> bool:
        """They are settled, and no mapper has gone for a second either."""
        return self.are_settled() and self._now() >= self._quiet_at_s

    def unshared(self) -> dict[str, list[str]]:
        """By mapper, those of this one's sites that it does not share, though it shares others of them. Where they are
        not quiet, one may be half gone.
        """
        with self._lock:
            members = {site: frozenset(self._members[site]) for site in self._sites}
        others = set[str]().union(*members.values()) - {self._name}
        lacking = {other: [site for site in self._sites if other not in members[site]] for other in sorted(others)}
        return {other: sites for other, sites in lacking.items() if sites}

    def let_in(self) -> str:
        """Count those that were left out of a site's members, where there is room again. Who is left out still, and
        why; empty while all are counted. Where the question fails, it is asked again at the next call.
        """
        with self._lock:
            named = set(self._left_out.items())
            self._gone &= named
            asked = {site for site, _ in self._gone} | {
                site for site in self._left_out if len(self._members[site]) < _MOST_MAPPERS
            }
        # All are asked before the first answer is awaited, as in service.other_mappers().
        for site, replies in [(site, _offers_of(self._session, site)) for site in asked]:
            samples = [reply.ok for reply in replies]
            if None not in samples:
                self._count_again(site, filter(None, samples))
        with self._lock:
            left_out = "; ".join(
                f"more than {_MOST_MAPPERS} mappers offer to map site {site}, and {name!r} is not counted: somebody "
                "makes up names, which certificates prevent"
                for site, name in self._left_out.items()
            )
        if left_out != self._told:
            _log.warning("%s", left_out or "all mappers are counted again")
            self._told = left_out
        return left_out

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
        if (offer := _offer(sample)) is None:
            return
        comes = sample.kind == zenoh.SampleKind.PUT
        with self._lock:
            if comes:
                self._gone.discard(offer)
                self._count(*offer)
            else:
                self._members[offer[0]].discard(offer[1])
                self._gone.add(offer)
        self._wait(SETTLED_AFTER_S if comes else GONE_AFTER_S)

    def _count_again(self, site: str, samples: Iterable[zenoh.Sample]) -> None:
        """Count those who offer to map the site; ``samples`` are all their tokens."""
        with self._lock:
            del self._left_out[site]
            for offer in filter(None, map(_offer, samples)):
                if offer not in self._gone:
                    self._count(*offer)
        self._wait(SETTLED_AFTER_S)

    def _count(self, site: str, member: str) -> None:
        members = self._members[site]
        if len(members) < _MOST_MAPPERS:
            members.add(member)
        elif member not in members:
            self._left_out.setdefault(site, member)

    def _wait(self, seconds: float) -> None:
        """They are not settled for so long, or longer where they were not yet."""
        now_s = self._now()
        with self._lock:
            self._settled_at_s = max(self._settled_at_s, now_s + seconds)
            self._quiet_at_s = now_s + SETTLED_AFTER_S


def _offer(sample: zenoh.Sample) -> tuple[str, str] | None:
    """Site and mapper of a token; None where it is no mapper's of ours."""
    try:
        return keys.parse_offer(str(sample.key_expr))
    except KeyFormatError:
        return None


def _offers_of(session: zenoh.Session, site: str) -> Iterator[zenoh.Reply]:
    """The replies as they come, in a queue without a limit: Zenoh's own holds 256, and a further one blocks get()."""
    replies = SimpleQueue[zenoh.Reply | None]()
    handler = zenoh.handlers.Callback(replies.put, lambda: replies.put(None))
    session.liveliness().get(keys.offer(site, keys.ANY), handler, timeout=_QUERY_TIMEOUT_S)
    return iter(replies.get, None)


def _is_connected(session: zenoh.Session) -> bool:
    return bool(list(session.info.transports()))


def _is_offered(session: zenoh.Session, site: str, name: str) -> bool:
    replies = session.liveliness().get(keys.offer(site, name), timeout=_QUERY_TIMEOUT_S)
    return any(reply.ok is not None for reply in replies)
