"""Commands of one unit on their way to it, each recorded before it is carried out, and again with what came of it."""

import logging
from collections.abc import Callable
from concurrent.futures import Future
from hashlib import sha256

from google.protobuf.json_format import MessageToDict

from noctule.caller import Who
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.audit.audit_log import AuditLog, Recorded
from noctule_gateway.audit.lines import Facts

Server = Callable[[str, CommandRequest], "Future[CommandReply]"]

CHANGE_NOTHING = ("hello", "status", "settings")

_log = logging.getLogger(__name__)


class RecordedCommands:
    """Hands commands to ``server``, the unit's, once they are in the audit log; what only asks is not recorded.

    A command does not fail because it can't be recorded: a stop matters more. Then the program's log has it. Where too
    many come, a command is only counted, and its outcome is not recorded either.
    """

    def __init__(self, server: Server, audit: AuditLog, unit: str) -> None:
        self._server, self._audit, self._unit = server, audit, unit

    def carry_out(self, name: str, request: CommandRequest, who: Who) -> "Future[CommandReply]":
        """The reply to come."""
        if name in CHANGE_NOTHING:
            return self._server(name, request)
        # What a client has made up is quoted: a line feed in it would begin a line of the log.
        _log.info("%s: %s by %r, request %r", self._unit, name, who.name, request.request_id)
        reply: Future[CommandReply] = Future()
        command = {"unit": self._unit, "command": name, "request_id": request.request_id}

        def begin(recorded: Recorded) -> None:
            self._server(name, request).add_done_callback(lambda done: end(recorded, done))

        def end(recorded: Recorded, done: "Future[CommandReply]") -> None:
            result = done.result()
            late = recorded.exception() is not None  # on a disk that hangs; it may be written yet
            payer = None if late else recorded.result()
            if late or payer is not None:
                outcome = {"event": "done" if result.done else "failed"} | command | _outcome(result)
                self._audit.append(outcome, payer)
            reply.set_result(result)

        given = {"event": "given", "who": who.name, "signed": who.signed} | command | _arguments(request)
        self._audit.append(given).add_done_callback(begin)
        return reply


def _arguments(request: CommandRequest) -> Facts:
    """What the command was given; of an image, what tells it from another."""
    image, told = request.image, CommandRequest()
    told.CopyFrom(request)
    for name in ("request_id", "image"):
        told.ClearField(name)
    arguments = MessageToDict(told, preserving_proto_field_name=True)
    if image:
        arguments["image"] = f"{len(image)} bytes, SHA-256 {sha256(image).hexdigest()}"
    return {"arguments": arguments}


def _outcome(reply: CommandReply) -> Facts:
    return {key: text for key, text in (("error", reply.error), ("detail", reply.detail)) if text}
