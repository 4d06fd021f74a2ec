"""The bus as Noctule uses it: sessions, states that a late joiner can ask for, and the messages' schemas."""

import logging
import re
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import zenoh
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from google.protobuf.message import Message

from noctule import (
    bus_config,
    endpoints,
    keys,
    messages_pb2,
    own_addresses,
    port_holder,
    reachability,
    silent_ends,
    tls,
)
from noctule.bus_config import CONFIG_VARIABLE, DEFAULT_ROUTER
from noctule.errors import BusError

__all__ = ["CONFIG_VARIABLE", "DEFAULT_ROUTER"]

_ATTEMPT_EVERY_S = 1.0

_log = logging.getLogger(__name__)


def open_session(
    connect: Sequence[str] = (),
    listen: Sequence[str] = (),
    patience_s: float | None = None,
    tls_folder: Path | None = None,
    while_waiting: Callable[[], None] = lambda: None,
    lease_s: float | None = None,
) -> zenoh.Session:
    """Open a session as a client of the routers ``connect``, or, with ``listen``, as a router itself.

    ``tls_folder``, or the folder that NOCTULE_TLS names, gives certificate and key (see ``noctule.tls``), and endpoints
    where neither ``connect`` nor ``listen`` does. Without any the router is DEFAULT_ROUTER. Without a folder, other
    settings are read from the Zenoh configuration file that ZENOH_CONFIG names.
    A client waits for its first router, for ever or for ``patience_s``; after that the session reconnects by itself.
    ``while_waiting`` is called after each attempt, so about once a second; what it raises ends the wait.
    ``lease_s`` is how long others take a session that says nothing for living; Zenoh's own is 10 s.
    A router begins without the addresses that this host does not have yet, and listens on each when it is there.
    The caller must close the session, or the process does not end.
    Raises BusError: no router in time, or an endpoint that can't be listened on; BusConfigError: one that is none;
    TlsError: a folder that can't be used.
    """
    identity = tls.chosen(tls_folder)
    config = bus_config.config(connect, listen, identity, lease_s)
    if bus_config.is_router(config):
        session = _open_router(config, identity)
    else:
        session = _open_client(config, identity, patience_s, while_waiting)
    silent_ends.bound(session, bus_config.endpoints_of(config, "connect"), bus_config.endpoints_of(config, "listen"))
    return session


@contextmanager
def closing(session: zenoh.Session) -> Iterator[zenoh.Session]:
    """The session, closed at the end. Zenoh's own ``with session`` fails while another thread is in a call on it."""
    try:
        yield session
    finally:
        session.close()


def _open_router(config: zenoh.Config, identity: tls.Identity | None) -> zenoh.Session:
    listen = bus_config.endpoints_of(config, "listen")
    if warning := bus_config.open_to_all(config):
        _log.warning("%s", warning)
    if missing := [endpoint for endpoint in listen if own_addresses.is_missing(endpoint)]:
        _log.warning("this host does not have the address of %s yet: waiting for it", endpoints.shown(missing))
        bus_config.wait_for_addresses(config)
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        name = f" as {identity.common_name}" if identity else ""
        raise BusError(f"can't be a router on {endpoints.shown(listen)}{name}: {_why_no_listener(error)}") from error


def _why_no_listener(error: zenoh.ZError) -> str:
    reason = str(error).split(" at /")[0]  # what follows is a place in Zenoh's source
    if taken := re.search(r":(\d+): Address already in use", reason):
        return port_holder.taken(int(taken[1]))
    return reason


def _open_client(
    config: zenoh.Config, identity: tls.Identity | None, patience_s: float | None, while_waiting: Callable[[], None]
) -> zenoh.Session:
    connect = bus_config.endpoints_of(config, "connect")
    began_s = monotonic()
    waiting = False
    # Zenoh could wait by itself, but then no signal would reach the process.
    while True:
        attempt_s = monotonic()
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            if patience_s is None and not waiting:
                _log.warning("%s; trying on", reachability.why_no_router(connect, identity))
                waiting = True
            elif patience_s is not None and monotonic() - began_s >= patience_s:
                raise BusError(reachability.why_no_router(connect, identity)) from error
            while_waiting()
            if (left_s := attempt_s + _ATTEMPT_EVERY_S - monotonic()) > 0:
                sleep(left_s)


def encoding(message_type: type[Message]) -> zenoh.Encoding:
    """The Zenoh encoding that says which message a payload holds: ``application/protobuf;noctule.v1.Sweep``."""
    return zenoh.Encoding.APPLICATION_PROTOBUF.with_schema(message_type.DESCRIPTOR.full_name)


def declare_publisher(session: zenoh.Session, key: str, message_type: type[Message]) -> zenoh.Publisher:
    """A publisher whose puts wait while a link is congested (Zenoh's default drops them), so they may take seconds."""
    return session.declare_publisher(
        key, encoding=encoding(message_type), congestion_control=zenoh.CongestionControl.BLOCK
    )


class StatePublisher:
    """Publishes a state and answers queries on its key with the last one, so that a late joiner sees the present.

    Its attachment, by which noctule.rivals tells one publisher from another, is the session's Zenoh id and the host.
    """

    def __init__(self, session: zenoh.Session, key: str, message_type: type[Message]) -> None:
        self.key = key
        self._encoding = encoding(message_type)
        self._instance = f"{session.zid()} {socket.gethostname()}"
        self.last: bytes | None = None  # what was put last
        self._publisher = declare_publisher(session, key, message_type)
        self._queryable = session.declare_queryable(key, self._answer, complete=True)

    def put(self, message: Message) -> None:
        """Publish ``message`` and keep it as the answer to queries."""
        self.last = message.SerializeToString()
        self._publisher.put(self.last, attachment=self._instance)

    def close(self) -> None:
        """Publish and answer no more."""
        self._queryable.undeclare()
        self._publisher.undeclare()

    def _answer(self, query: zenoh.Query) -> None:
        if self.last is not None:
            query.reply(self.key, self.last, encoding=self._encoding)


class StatesPublisher:
    """As a StatePublisher for each key that ``expression`` matches, up to ``most``, with one queryable for all.

    Zenoh gives each queryable a thread. ``refused`` is how many keys found no room.
    """

    def __init__(self, session: zenoh.Session, expression: str, message_type: type[Message], most: int) -> None:
        self._session, self._encoding, self._most = session, encoding(message_type), most
        self._last: dict[str, bytes] = {}
        self._refused: set[str] = set()
        self._queryable = session.declare_queryable(expression, self._answer, complete=True)

    @property
    def refused(self) -> int:
        """How many keys' states are not published; those beyond as many as may be published are not counted."""
        return len(self._refused)

    def put(self, key: str, message: Message) -> None:
        """Publish ``message`` and keep it as the answer to queries of ``key``, if there is room."""
        if key not in self._last and len(self._last) >= self._most:
            if len(self._refused) < self._most:
                self._refused.add(key)
            return
        self._refused.discard(key)
        payload = self._last[key] = message.SerializeToString()
        self._session.put(key, payload, encoding=self._encoding, congestion_control=zenoh.CongestionControl.BLOCK)

    def forget(self, key: str) -> None:
        """Answer no query with the state of ``key`` any more."""
        self._last.pop(key, None)
        self._refused.discard(key)

    def close(self) -> None:
        """Answer no more."""
        self._queryable.undeclare()

    def _answer(self, query: zenoh.Query) -> None:
        asked = query.key_expr
        known = dict(self._last)
        keys_asked = (
            [str(asked)] if "*" not in str(asked) else [key for key in known if asked.intersects(zenoh.KeyExpr(key))]
        )
        for key in keys_asked:
            if key in known:
                query.reply(key, known[key], encoding=self._encoding)


@cache
def schemas() -> Mapping[str, bytes]:
    """By key, each message's schema (FileDescriptorSet). All messages are of one file, so all schemas are alike."""
    schema = file_descriptor_set(messages_pb2.DESCRIPTOR).SerializeToString()
    return {
        keys.schema(message.full_name): schema for message in messages_pb2.DESCRIPTOR.message_types_by_name.values()
    }


def declare_schemas(session: zenoh.Session) -> zenoh.Queryable:
    """Answer queries for any message's schema until the result is undeclared."""

    def answer(query: zenoh.Query) -> None:
        for key, reply in schemas().items():
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
