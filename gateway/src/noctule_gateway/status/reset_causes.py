"""Why a unit has restarted, in words: what its HELLO says of it.

RSTSRC is the C8051F340's own register (datasheet C8051F34x Rev. 1.3, chapter 11); after a power-up its other bits mean
nothing.
"""

from noctule_gateway.wire.frames import Hello

_ORDERED = {1: "it was ordered to", 3: "it was ordered into its loader for an update", 4: "its loader has started it"}
_STACK = 2
_NOT_GREETED = 5
_POWER = 0x02
_SOFTWARE = 0x10
_CAUSES = {
    0x40: "its firmware has touched flash that it must not: report it",
    0x08: "watchdog reset: the firmware hung",
    0x04: "its clock has failed",
    _SOFTWARE: "its firmware has reset the chip",
    0x01: "its reset pin was pulled",
}


def cause(hello: Hello) -> str:
    """Why it has started."""
    if hello.reset_note == _STACK:
        return "its stack has met its canary, which is a fault of the firmware: report it"
    if hello.reset_note == _NOT_GREETED:
        return "nobody has greeted its new firmware for five minutes, which its loader takes for a failed start"
    if hello.reset_note in _ORDERED:
        return _ORDERED[hello.reset_note]
    if hello.reset_cause & _POWER:
        return "power has come on"
    return next((words for bit, words in _CAUSES.items() if hello.reset_cause & bit), "for no cause that it knows")


def warning(hello: Hello, met_before: bool) -> str:
    """What an operator should hear of it, empty if it is in order. ``met_before``: by this gateway, before it reset."""
    if hello.reset_note in _ORDERED:
        return ""
    if hello.reset_cause & _POWER and hello.reset_note != _STACK:
        return "its power was cut, or sagged (brown-out): check its supply" if met_before else ""
    return cause(hello)
