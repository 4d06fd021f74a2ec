"""Which sockets of a process get a bound on how long they wait for a silent end."""

import socket
from contextlib import suppress
from pathlib import Path

import pytest
import zenoh
from system.processes import wait_until

from noctule import bus, endpoints, silent_ends

pytestmark = pytest.mark.skipif(not hasattr(socket, "TCP_USER_TIMEOUT"), reason="only Linux has the option")
NOBODYS = "tcp/192.0.2.1:7447"  # RFC 5737: an address that no host has


def test_a_router_bounds_what_it_accepts_without_a_look_at_other_sockets(endpoint: str) -> None:
    with bus.open_session(listen=[endpoint]) as router, plain_client(endpoint):
        wait_until(lambda: len(bounds(endpoint)) == 2, "nothing is accepted")
        silent_ends_know(router)
        assert bounds(endpoint) == [silent_ends.OF_CLIENT_MS] * 2
        assert bounds(endpoint, of_peer=True) == [0]  # the client's, which is not the router's


def test_a_router_that_does_not_listen_everywhere_yet_looks_at_each_client(endpoint: str) -> None:
    with plain(endpoint, "router", "listen") as router:
        silent_ends.bound(router, [endpoint], [NOBODYS])
        with plain_client(endpoint):
            wait_until(lambda: bounds(endpoint, of_peer=True) == [silent_ends.OF_ROUTER_MS], "it has not looked")


def test_a_client_bounds_its_own_connection_and_leaves_all_descriptors_open(endpoint: str) -> None:
    with plain(endpoint, "router", "listen"), socket.socket() as other, bus.open_session([endpoint]):
        wait_until(lambda: bounds(endpoint, of_peer=True) == [silent_ends.OF_ROUTER_MS], "it is not bounded")
        assert other.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) == 0


def silent_ends_know(router: zenoh.Session) -> None:
    """Wait until the router has told its listeners of the client."""
    told = []
    router.info.declare_transport_events_listener(told.append, history=True)
    wait_until(lambda: told, "no client")


def plain(endpoint: str, mode: str, side: str) -> zenoh.Session:
    """A session with nothing of ours."""
    config = zenoh.Config()
    for key, value in (
        ("mode", f'"{mode}"'),
        (f"{side}/endpoints", f'["{endpoint}"]'),
        ("scouting/multicast/enabled", "false"),
    ):
        config.insert_json5(key, value)
    return zenoh.open(config)


def plain_client(endpoint: str) -> zenoh.Session:
    return plain(endpoint, "client", "connect")


def bounds(endpoint: str, of_peer: bool = False) -> list[int]:
    """The option, in ms, of this process's sockets at the endpoint's port, or of those connected to it."""
    place = endpoints.host_and_port(endpoint)
    found = []
    for path in list(Path("/proc/self/fd").iterdir()):
        with suppress(OSError):  # others are no sockets, or connected to nothing
            each = socket.socket(fileno=int(path.name))
            try:
                address = each.getpeername() if of_peer else each.getsockname()
                if place is not None and each.type == socket.SOCK_STREAM and address[1:2] == (place[1],):
                    found.append(each.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT))
            finally:
                each.detach()
    return found
