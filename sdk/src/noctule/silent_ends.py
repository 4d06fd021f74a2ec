"""Connections whose far end has gone without a word, as a host does that loses its power: the kernel ends them.

Zenoh 1.10 notices such an end by its lease, but closes a link of TLS only when what it is writing is written
(eclipse-zenoh/zenoh#1896). With a full send buffer, as a map fills it, that takes as long as TCP tries: a quarter of an
hour, in which the session has no router. Zenoh has no setting for it, so the sockets get TCP_USER_TIMEOUT here.
"""

import os
import socket
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

import zenoh

from noctule import endpoints

LONGEST_MS = 10_000
"""How long sent bytes may stay unacknowledged: as long as Zenoh's own lease."""
_DESCRIPTORS = Path("/proc/self/fd")
_OPTION: int | None = getattr(socket, "TCP_USER_TIMEOUT", None)  # Linux has it


def bound(session: zenoh.Session, of_session: Iterable[str]) -> None:
    """Bound how long a silent end is waited for, in all connections that ``session`` has or will have.

    ``of_session`` are its endpoints. Sockets are told by their ports, and those that listen pass it on.
    """
    ports = frozenset(place[1] for each in of_session if (place := endpoints.host_and_port(each)))
    if _OPTION is None or not _DESCRIPTORS.is_dir():
        return
    option = _OPTION
    _bound_all(ports, option)  # a router's, which listen already

    def opened(event: zenoh.TransportEvent) -> None:
        if event.kind == zenoh.SampleKind.PUT:
            _bound_all(ports, option)

    session.info.declare_transport_events_listener(opened, history=True)


def _bound_all(ports: frozenset[int], option: int) -> None:
    for each in _tcp_sockets():
        with each, suppress(OSError):  # it has been closed
            if not ports.isdisjoint(_ports(each)):
                each.setsockopt(socket.IPPROTO_TCP, option, LONGEST_MS)


def _tcp_sockets() -> Iterator[socket.socket]:
    """A copy of each socket of TCP that this process has; the caller closes it."""
    for each in _DESCRIPTORS.iterdir():
        with suppress(OSError):
            if str(each.readlink()).startswith("socket:"):
                found = socket.socket(fileno=os.dup(int(each.name)))
                if found.family in (socket.AF_INET, socket.AF_INET6) and found.type == socket.SOCK_STREAM:
                    yield found
                else:
                    found.close()


def _ports(each: socket.socket) -> Iterator[int]:
    yield each.getsockname()[1]
    with suppress(OSError):  # it listens
        yield each.getpeername()[1]
