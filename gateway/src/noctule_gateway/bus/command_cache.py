"""Commands from the bus, each carried out once: a second one of the same request_id gets the reply of the first.

Few may be under way, so that a flood of commands fills no memory, and a stop does not wait behind them.
"""

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future

from noctule.messages_pb2 import CommandReply, CommandRequest

MAX_UNDER_WAY = 16  # commands to one unit
MAX_IMAGES_UNDER_WAY = 1  # a unit is updated once at a time, and an image has up to a megabyte
STOP, UPDATE = "stop", "update"

_REMEMBERED = 100

Server = Callable[[str, CommandRequest], "Future[CommandReply]"]


class CommandCache:
    """The latest commands to one unit, and what became of them. From any thread.

    ``refused`` counts those that found too many under way. The limit is for stops and for all others apart.
    """

    def __init__(self, server: Server) -> None:
        self.refused = 0
        self._server = server
        self._lock = threading.Lock()
        self._replies: OrderedDict[str, Future[CommandReply]] = OrderedDict()
        self._under_way: dict[str, list[Future[CommandReply]]] = {STOP: [], UPDATE: [], "": []}

    def carry_out(self, name: str, request: CommandRequest) -> "Future[CommandReply]":
        """The reply to come: of this request, or of the one that came first under its request_id."""
        if not request.request_id:
            return _refusal(request, "request_id is empty: give each command one of its own")
        with self._lock:
            if request.request_id not in self._replies:
                if too_many := self._too_many(name):
                    self.refused += 1
                    return _refusal(request, too_many, under_way=name == UPDATE)
                self._replies[request.request_id] = self._begin(name, request)
                if len(self._replies) > _REMEMBERED:
                    self._replies.popitem(last=False)
            return self._replies[request.request_id]

    def _begin(self, name: str, request: CommandRequest) -> "Future[CommandReply]":
        if name != UPDATE:
            request.ClearField("image")  # nobody reads it
        reply = self._server(name, request)
        self._kind(name).append(reply)
        return reply

    def _too_many(self, name: str) -> str:
        """Why no more commands of this kind can be taken; empty if they can."""
        under_way = self._kind(name)
        under_way[:] = [reply for reply in under_way if not reply.done()]
        if name == UPDATE and len(under_way) >= MAX_IMAGES_UNDER_WAY:
            return "the unit is being updated: wait until that is over, its status says how far it is"
        if len(under_way) >= MAX_UNDER_WAY:
            return f"{len(under_way)} commands to this unit are under way: wait until they are answered, then try again"
        return ""

    def _kind(self, name: str) -> "list[Future[CommandReply]]":
        return self._under_way[name if name in self._under_way else ""]


def _refusal(request: CommandRequest, why: str, under_way: bool = False) -> "Future[CommandReply]":
    refusal: Future[CommandReply] = Future()
    refusal.set_result(CommandReply(request_id=request.request_id, error=why, under_way=under_way))
    return refusal
