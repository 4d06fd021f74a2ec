"""Whether this host has the address of an endpoint: that of a VPN or of a network card may come after the program."""

import errno
import socket

from noctule import endpoints


def is_missing(endpoint: str) -> bool:
    """Whether the endpoint's address can't be listened on because this host does not have it, or not by that name."""
    place = endpoints.host_and_port(endpoint)
    if place is None:
        return False
    try:
        found = socket.getaddrinfo(place[0], 0, type=socket.SOCK_STREAM)
    except (socket.gaierror, UnicodeError):
        return True
    return all(_is_missing(family, address) for family, _, _, _, address in found)


def _is_missing(family: int, address: tuple[object, ...]) -> bool:
    try:
        with socket.socket(family) as probe:
            probe.bind(address)
    except OSError as error:
        return error.errno == errno.EADDRNOTAVAIL
    return False
