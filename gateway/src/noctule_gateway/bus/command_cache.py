"""Commands from the bus, each carried out once: the same one again, by its request_id, gets the reply of the first.

Few may be under way, so that a flood of commands fills no memory, and a stop does not wait behind them.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from hashlib import sha256

from noctule.caller import Who
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.errors import BEING_UPDATED

MAX_UNDER_WAY = 16  # commands to one unit
MAX_IMAGES_UNDER_WAY = 1  # a unit is updated once at a time, and an image has up to a megabyte
STOP, UPDATE = "stop", "update"

_REMEMBERED = 100

Server = Callable[[str, CommandRequest, Who], "Future[CommandReply]"]
Refused = Callable[[str, str, Who, str], None]  # command, request_id, who, why


@dataclass(frozen=True)
class _Known:
    """A command that was begun: its name, the SHA-256 of its request, and the reply to come."""

    name: str
    digest: bytes
    reply: "Future[CommandReply]"


class CommandCache:
    """The latest commands to one unit, and what became of them. From any thread.

    ``refused`` counts those that found too many under way, or had none or another one's request_id; ``note_refused`` is
    called with each. The limit is for stops and for all others apart.
    """

    def __init__(self, server: Server, note_refused: Refused) -> None:
        self.refused = 0
        self._server, self._note_refused = server, note_refused
        self._lock = threading.Lock()
        self._known: OrderedDict[str, _Known] = OrderedDict()
        self._under_way: dict[str, list[Future[CommandReply]]] = {STOP: [], UPDATE: [], "": []}

    def carry_out(self, name: str, request: CommandRequest, who: Who) -> "Future[CommandReply]":
        """The reply to come: of this request, or of the same one that came before under its request_id."""
        digest = sha256(request.SerializeToString(deterministic=True)).digest()
        with self._lock:
            known = self._known.get(request.request_id)
            if known is not None and (known.name, known.digest) == (name, digest):
                return known.reply
            why = _unusable(request, known) or self._too_many(name)
            if not why:
                return self._begin_known(name, request, who, digest)
            self.refused += 1
        self._note_refused(name, request.request_id, who, why)
        return _refusal(request, why)

    def _begin_known(self, name: str, request: CommandRequest, who: Who, digest: bytes) -> "Future[CommandReply]":
        reply = self._begin(name, request, who)
        self._known[request.request_id] = _Known(name, digest, reply)
        if len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        return reply

    def _begin(self, name: str, request: CommandRequest, who: Who) -> "Future[CommandReply]":
        if name != UPDATE:
            request.ClearField("image")  # nobody reads it
        reply = self._server(name, request, who)
        self._kind(name).append(reply)
        return reply

    def _too_many(self, name: str) -> str:
        """Why no more commands of this kind can be taken; empty if they can."""
        under_way = self._kind(name)
        under_way[:] = [reply for reply in under_way if not reply.done()]
        if name == UPDATE and len(under_way) >= MAX_IMAGES_UNDER_WAY:
            return BEING_UPDATED
        if len(under_way) >= MAX_UNDER_WAY:
            return f"{len(under_way)} commands to this unit are under way: wait until they are answered, then try again"
        return ""

    def _kind(self, name: str) -> "list[Future[CommandReply]]":
        return self._under_way[name if name in self._under_way else ""]


def _unusable(request: CommandRequest, known: _Known | None) -> str:
    """Why no command can go under this request_id, under which ``known`` has come before; empty if one can."""
    if not request.request_id:
        return "request_id is empty: give each command one of its own"
    if known is not None:
        return f"its request_id was used for another command ({known.name}): give each command its own"
    return ""


def _refusal(request: CommandRequest, why: str) -> "Future[CommandReply]":
    refusal: Future[CommandReply] = Future()
    under_way = why == BEING_UPDATED
    refusal.set_result(CommandReply(request_id=request.request_id, error=why, under_way=under_way))
    return refusal
