"""Zenoh endpoints taken apart: ``tls/router-1:7447?metadata#configuration``."""

import ipaddress
import re
from collections.abc import Iterable

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"
LAST_PORT = 65535
_OF_HOSTS = frozenset({"tcp", "tls", "udp", "quic", "ws"})
_PROTOCOLS = _OF_HOSTS | {"unixsock-stream"}  # Zenoh's wheels speak no other


def protocol(endpoint: str) -> str:
    """``tls`` of ``tls/router-1:7447``."""
    return endpoint.partition("/")[0]


def host_and_port(endpoint: str) -> tuple[str, int] | None:
    """Host and port; None where the endpoint has none, as a serial line."""
    host, _, port = _bare(endpoint).partition("/")[2].rpartition(":")
    return (host.strip("[]"), int(port)) if host and port.isdecimal() else None


def fault(endpoint: str) -> str:
    """What is wrong with an endpoint as it is written; empty where Zenoh may make something of it."""
    name = protocol(endpoint)
    if name not in _PROTOCOLS:
        return f"{_bare(endpoint)!r} is no endpoint: write tcp/HOST:PORT"
    if name not in _OF_HOSTS:
        return ""
    place = host_and_port(endpoint)
    if place is None:
        return f"{_bare(endpoint)} has no port: write {name}/HOST:PORT"
    return "" if place[1] <= LAST_PORT else f"{_bare(endpoint)}: port {place[1]} is none: give 1 to {LAST_PORT}"


def is_loopback(endpoint: str) -> bool:
    """Whether only this host can reach what listens there."""
    place = host_and_port(endpoint)
    if place is None:
        return protocol(endpoint).startswith("unixsock")
    try:
        return ipaddress.ip_address(place[0]).is_loopback
    except ValueError:
        return place[0] == "localhost"


def shown(endpoints: Iterable[str]) -> str:
    """Endpoints for a message, without their configuration, which may hold keys."""
    return ", ".join(map(_bare, endpoints)) or "no endpoint"


def _bare(endpoint: str) -> str:
    return re.split("[?#]", endpoint, maxsplit=1)[0]
