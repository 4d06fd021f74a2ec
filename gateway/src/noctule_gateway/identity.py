"""Is the unit on the line the one that the site file names there, and does it speak our protocol?"""

from noctule_gateway.errors import WrongUnitError
from noctule_gateway.frames import NO_SERIAL, PROTOCOL, Hello, Loader


def mismatch(hello: Hello | Loader, serial: int) -> WrongUnitError | None:
    """What is wrong with who says ``hello`` where unit ``serial`` is expected; None if nothing is."""
    if hello.protocol != PROTOCOL:
        return WrongUnitError(f"the unit speaks protocol {hello.protocol}, the gateway {PROTOCOL}: update one of them")
    if hello.serial != serial:
        found = "a unit without a serial number" if hello.serial == NO_SERIAL else f"unit {hello.serial}"
        return WrongUnitError(f"{found} answers where the site file has {serial}: check cable and address")
    return None
