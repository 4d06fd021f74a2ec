"""The address of a Rerun relay, as a user types it."""

import re

from noctule import rerun_paths
from noctule.endpoints import LAST_PORT
from noctule.errors import NoctuleError


class RelayAddressError(NoctuleError):
    """An address that is not one of a Rerun relay."""


def host_and_port(url: str) -> tuple[str, int]:
    """Of ``rerun+http://127.0.0.1:9876/proxy``, also with ``#sites`` behind it. Raises RelayAddressError."""
    address = re.fullmatch(r"rerun\+http://([^/:]+):(\d{1,5})/proxy(?:#sites)?", url)
    if address is None:
        raise RelayAddressError(
            f"{url!r} is not a relay's address: it should read rerun+http://HOST:PORT/proxy, "
            f"with {rerun_paths.SEVERAL_SITES} behind it where the relay shows several sites"
        )
    if not 1 <= (port := int(address[2])) <= LAST_PORT:
        raise RelayAddressError(f"{url!r}: port {port} is none: give 1 to {LAST_PORT}")
    return address[1], port
