"""Connections whose far end has gone without a word, as a host does that loses its power: the kernel ends them.

Zenoh 1.10 notices such an end by its lease, but closes a link of TLS only when what it is writing is written
(eclipse-zenoh/zenoh#1896). With a full send buffer, as a map fills it, that takes as long as TCP tries: a quarter of an
hour, in which the session has no router. Zenoh has no setting for it, so the sockets get TCP_USER_TIMEOUT here.

The option also ends a connection to a host that lives, whose program has read nothing for so long with its buffer full:
one that is stopped, or starved. Such a program connects again, and reads on from the log. A router waits longer for it
than a program waits for its router, in whose place there may be another.
"""

import socket
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import zenoh

from noctule import endpoints

OF_ROUTER_MS = 10_000
"""How long what was sent to a router may stay unacknowledged: as long as Zenoh's own lease."""
OF_CLIENT_MS = 30_000
"""The same of what a router has sent to one that has connected to it, and may be slow to read."""
_DESCRIPTORS = Path("/proc/self/fd")
_OPTION: int | None = getattr(socket, "TCP_USER_TIMEOUT", None)  # Linux has it


def bound(session: zenoh.Session, connect: Sequence[str], listen: Sequence[str]) -> None:
    """Bound how long a silent end is waited for, in all connections that ``session`` has or will have.

    ``connect`` and ``listen`` are its endpoints; their ports tell which sockets are meant. Those that are accepted have
    the option from the one that listens. So a client that comes is no reason to look through the process's sockets,
    unless an address was not there yet to listen on.
    """
    if _OPTION is None or not _DESCRIPTORS.is_dir():
        return
    option, routers, own = _OPTION, _ports_of(connect), _ports_of(listen)
    listening = _bound_all(routers, own, option)  # a router's, which listen already

    def opened(event: zenoh.TransportEvent) -> None:
        nonlocal listening
        if event.kind != zenoh.SampleKind.PUT:
            return
        if event.transport.whatami != zenoh.WhatAmI.CLIENT or listening < len(listen):
            listening = _bound_all(routers, own, option)

    session.info.declare_transport_events_listener(opened, history=True)


def _ports_of(places: Sequence[str]) -> frozenset[int]:
    return frozenset(place[1] for each in places if (place := endpoints.host_and_port(each)))


def _bound_all(routers: frozenset[int], own: frozenset[int], option: int) -> int:
    """Give the option to all sockets connected to ports of ``routers`` or at ``own`` ports; returns how many of them
    listen.
    """
    listening = 0
    for name in [each.name for each in _DESCRIPTORS.iterdir()]:
        with suppress(OSError), _tcp_socket(name) as found:  # it has been closed
            if found is None:
                continue
            if found.getsockname()[1] in own:
                found.setsockopt(socket.IPPROTO_TCP, option, OF_CLIENT_MS)
                listening += found.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
            elif found.getpeername()[1] in routers:
                found.setsockopt(socket.IPPROTO_TCP, option, OF_ROUTER_MS)
    return listening


@contextmanager
def _tcp_socket(descriptor: str) -> Iterator[socket.socket | None]:
    """The socket of TCP behind a descriptor, which stays open; None if it is none. Raises OSError: it is closed."""
    if not str((_DESCRIPTORS / descriptor).readlink()).startswith("socket:"):
        yield None
        return
    found = socket.socket(fileno=int(descriptor))
    try:
        tcp = found.family in (socket.AF_INET, socket.AF_INET6) and found.type == socket.SOCK_STREAM
        yield found if tcp else None
    finally:
        found.detach()
