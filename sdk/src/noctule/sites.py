"""Which sites are on the bus: for who has mistyped one."""

from contextlib import suppress

import zenoh

from noctule import keys
from noctule.errors import KeyFormatError

_TIMEOUT_S = 2.0


def on_bus(session: zenoh.Session) -> list[str]:
    """The sites of which a gateway serves a unit, in order; those that the session's certificate may not read are not
    among them.
    """
    tokens = session.liveliness().get(keys.alive(keys.ANY, keys.ANY), timeout=_TIMEOUT_S)
    found: set[str] = set()
    for reply in tokens:
        if reply.ok is not None:
            with suppress(KeyFormatError):
                found.add(keys.parse_unit(str(reply.ok.key_expr)).site)
    return sorted(found)
