"""Others that publish a state which only one program should: a second gateway on a unit, a second mapper of a site.

A state names the session that published it and its host (its attachment, see bus.StatePublisher): two programs may
bear one name.
"""

import logging
import re
from collections.abc import Callable
from time import monotonic
from typing import Generic, TypeVar

import zenoh
from google.protobuf.message import Message

from noctule import bounds
from noctule.errors import BoundsError

GONE_AFTER_S = 5.0  # states are published each second
_HELD = 32  # states that came since they were last looked at; the oldest go
_MOST, _LISTED = 16, 3
_HOST = re.compile(r"[\w.-]{1,64}", re.ASCII)  # a host of Linux; a stranger could name any

M = TypeVar("M", bound=Message)

_log = logging.getLogger(__name__)


class Rivals(Generic[M]):
    """Listens on ``key`` from its making until close(). For one thread at a time; it has none of its own.

    ``name_of`` gives the publisher's name in a message, empty for one that is no rival.
    """

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        message_type: type[M],
        name_of: Callable[[M], str],
        now: Callable[[], float] = monotonic,
    ) -> None:
        self._key, self._type, self._name_of, self._now = key, message_type, name_of, now
        self._own = str(session.zid())
        self._heard: dict[str, tuple[str, float]] = {}  # by session: the name and the host, and when
        self._logged: list[str] = []
        self._subscriber = session.declare_subscriber(key, zenoh.handlers.RingChannel(_HELD))

    def names(self) -> list[str]:
        """Who else has published within GONE_AFTER_S, one for each session: NAME on HOST, where it gives its host."""
        now_s = self._now()
        while (sample := self._subscriber.try_recv()) is not None:
            self._note(sample, now_s)
        self._heard = {key: heard for key, heard in self._heard.items() if now_s - heard[1] <= GONE_AFTER_S}
        names = sorted(name for name, _ in self._heard.values())
        if names != self._logged:
            if names:
                _log.warning("%s is published by %s too: stop one of them", self._key, " and ".join(names))
            else:
                _log.info("%s is published by nobody else any more", self._key)
        self._logged = names
        return names

    def listed(self) -> str:
        """Some of the names, as a status has them; empty where there is nobody else."""
        names = self.names()
        more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
        return ", ".join(names[:_LISTED]) + more

    def close(self) -> None:
        """Listen no more."""
        self._subscriber.undeclare()

    def _note(self, sample: zenoh.Sample, now_s: float) -> None:
        attached = sample.attachment.to_bytes().decode(errors="replace") if sample.attachment is not None else ""
        session, _, host = attached.partition(" ")
        if session == self._own or (session not in self._heard and len(self._heard) >= _MOST):
            return
        try:
            name = self._name_of(bounds.decode(self._type, sample.payload.to_bytes()))
        except BoundsError:
            return
        if name:
            self._heard[session] = (f"{name} on {host}" if _HOST.fullmatch(host) else name), now_s
