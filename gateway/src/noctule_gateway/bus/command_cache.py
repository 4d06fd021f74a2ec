"""Commands from the bus, each carried out once: whoever asks again under the same request_id gets the first reply."""

import threading
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future

from noctule.messages_pb2 import CommandReply, CommandRequest

_REMEMBERED = 100

Server = Callable[[str, CommandRequest], "Future[CommandReply]"]


class CommandCache:
    """The latest commands to one unit, and what became of them. From any thread."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._lock = threading.Lock()
        self._replies: OrderedDict[str, Future[CommandReply]] = OrderedDict()

    def carry_out(self, name: str, request: CommandRequest) -> "Future[CommandReply]":
        """The reply to come: of this request, or of the one that came first under its request_id."""
        if not request.request_id:
            refusal: Future[CommandReply] = Future()
            refusal.set_result(CommandReply(error="request_id is empty: give each command one of its own"))
            return refusal
        with self._lock:
            if request.request_id not in self._replies:
                self._replies[request.request_id] = self._server(name, request)
                if len(self._replies) > _REMEMBERED:
                    self._replies.popitem(last=False)
            return self._replies[request.request_id]
