"""The bus as Noctule uses it: sessions, states that a late joiner can ask for, and the messages' schemas."""

import json
import logging
import os
from collections.abc import Sequence
from time import monotonic
from typing import Any

import zenoh
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from noctule import keys, messages_pb2
from noctule.errors import BusConfigError, BusError

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
CONFIG_VARIABLE = "ZENOH_CONFIG"

_ATTEMPT_MS = 1000
_SETTINGS = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,  # nothing is scouted, so nothing is to be waited for
    "transport/shared_memory/enabled": False,
    # An open session looks for its routers for ever, and often enough that an outage is soon over.
    "connect/timeout_ms": _ATTEMPT_MS,
    "connect/exit_on_failure": False,
    "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000, "period_increase_factor": 2},
}

_log = logging.getLogger(__name__)


def open_session(
    connect: Sequence[str] = (), listen: Sequence[str] = (), patience_s: float | None = None
) -> zenoh.Session:
    """Open a session as a client of the routers ``connect``, or, with ``listen``, as a router itself.

    A client waits for its first router, for ever or for ``patience_s``; after that the session reconnects by itself.
    What else there is to set (certificates) is read from the Zenoh configuration file that ZENOH_CONFIG names.
    The caller must close the session, or the process does not end.
    Raises BusError: no router in time, or an endpoint that can't be listened on; BusConfigError: one that is none.
    """
    config = _config(connect, listen)
    return _open_router(config, listen) if listen else _open_client(config, connect, patience_s)


def _open_router(config: zenoh.Config, listen: Sequence[str]) -> zenoh.Session:
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).split(" at /")[0]  # what follows is a place in Zenoh's source
        raise BusError(f"can't be a router on {', '.join(listen)}: {reason}") from error


def _open_client(config: zenoh.Config, connect: Sequence[str], patience_s: float | None) -> zenoh.Session:
    where = ", ".join(connect) or "no endpoint"
    began_s = monotonic()
    waiting = False
    # Zenoh could wait by itself, but then no signal would reach the process.
    while True:
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if patience_s is None and not waiting:
                _log.warning("no router answers at %s yet; trying on", where)
                waiting = True
            elif patience_s is not None and monotonic() - began_s >= patience_s:
                raise BusError(f"no router answers at {where}: start one, or name another endpoint") from error


def _config(connect: Sequence[str], listen: Sequence[str]) -> zenoh.Config:
    try:
        config = zenoh.Config.from_env() if os.environ.get(CONFIG_VARIABLE) else zenoh.Config()
    except zenoh.ZError as error:
        raise BusConfigError(f"the Zenoh configuration that {CONFIG_VARIABLE} names can't be read: {error}") from error
    settings = _SETTINGS | {
        "mode": "router" if listen else "client",
        "connect/endpoints": list(connect),
        "listen/endpoints": list(listen),
    }
    for key, value in settings.items():
        try:
            config.insert_json5(key, json.dumps(value))
        except zenoh.ZError as error:
            raise BusConfigError(f"{key} can't be {value}: write an endpoint as tcp/HOST:PORT") from error
    return config


def encoding(message_type: type[Message]) -> zenoh.Encoding:
    """The Zenoh encoding that says which message a payload holds: ``application/protobuf;noctule.v1.Sweep``."""
    return zenoh.Encoding.APPLICATION_PROTOBUF.with_schema(message_type.DESCRIPTOR.full_name)


def declare_publisher(session: zenoh.Session, key: str, message_type: type[Message]) -> zenoh.Publisher:
    """A publisher whose puts wait while a link is congested (Zenoh's default drops them), so they may take seconds."""
    return session.declare_publisher(
        key, encoding=encoding(message_type), congestion_control=zenoh.CongestionControl.BLOCK
    )


class StatePublisher:
    """Publishes a state and answers queries on its key with the last one, so that a late joiner sees the present."""

    def __init__(self, session: zenoh.Session, key: str, message_type: type[Message]) -> None:
        self._key = key
        self._encoding = encoding(message_type)
        self._last: bytes | None = None
        self._publisher = declare_publisher(session, key, message_type)
        self._queryable = session.declare_queryable(key, self._answer, complete=True)

    def put(self, message: Message) -> None:
        """Publish ``message`` and keep it as the answer to queries."""
        self._last = message.SerializeToString()
        self._publisher.put(self._last)

    def close(self) -> None:
        """Publish and answer no more."""
        self._queryable.undeclare()
        self._publisher.undeclare()

    def _answer(self, query: zenoh.Query) -> None:
        if self._last is not None:
            query.reply(self._key, self._last, encoding=self._encoding)


def declare_schemas(session: zenoh.Session) -> zenoh.Queryable:
    """Answer queries for any message's schema (FileDescriptorSet) until the result is undeclared."""
    replies = {
        keys.schema(message.full_name): file_descriptor_set(message.file).SerializeToString()
        for message in messages_pb2.DESCRIPTOR.message_types_by_name.values()
    }

    def answer(query: zenoh.Query) -> None:
        for key, reply in replies.items():
            if query.key_expr.intersects(zenoh.KeyExpr(key)):
                query.reply(key, reply, encoding=encoding(FileDescriptorSet))

    return session.declare_queryable(keys.schema(keys.ANY), answer, complete=True)


def file_descriptor_set(file: Any) -> FileDescriptorSet:
    """The file (a FileDescriptor) and all that it imports, imports first, as a reader without our code needs them."""
    files: dict[str, Any] = {}

    def collect(file: Any) -> None:
        for dependency in file.dependencies:
            collect(dependency)
        files[file.name] = file

    collect(file)
    result = FileDescriptorSet()
    for imported in files.values():
        imported.CopyToProto(result.file.add())
    return result
