"""What the fields of frames hold: the integers of the wire, and the values that mean something."""

from enum import IntEnum
from typing import Annotated, NamedTuple


class Wire(NamedTuple):
    """How an integer lies on the line, little-endian."""

    size_bytes: int
    signed: bool = False


U8 = Annotated[int, Wire(1)]
U16 = Annotated[int, Wire(2)]
I16 = Annotated[int, Wire(2, signed=True)]
U24 = Annotated[int, Wire(3)]
U32 = Annotated[int, Wire(4)]
U48 = Annotated[int, Wire(6)]

PROTOCOL = 3
PROTOCOLS = (2, PROTOCOL)  # that the gateway speaks; protocol 2 has Sweep2 and Ack2 for Sweep and Ack, and no For
NO_SERIAL = 0xFFFFFFFF
NO_LIFE = 0  # of a unit of protocol 2
NO_WAYPOINT = 0xFFFF
NO_TEMPERATURE = 0x7FFF
NO_SLIP = 0x7FFF
NEVER = 0xFFFFFF
FIRST_NO_ECHO = 0xFFFFF0  # from here on an echo field names a kind of no echo
MAX_READINGS = 64
MAX_REQUEST = 255
MAX_PUT_BYTES = 128


class NoEcho(IntEnum):
    """Why a reading has no time of flight, as its echo field names it."""

    NO_ECHO = 0xFFFFFF
    TOO_EARLY = 0xFFFFFE
    STUCK_HIGH = 0xFFFFFD
    NO_SENSOR = 0xFFFFFC


class State(IntEnum):
    """What a unit is doing."""

    IDLE = 0
    SWEEPING = 1
    HOMING = 2
    WAITING = 3
    FAULT = 4
    PAUSING = 5
    TURNING = 6
    MEASURING = 7


class MeasureKind(IntEnum):
    """What a unit measures of itself."""

    PLAY = 0
    TURN = 1
    ROUND = 2
    PING = 3


class Measured(IntEnum):
    """What became of that."""

    NOTHING = 0
    UNDER_WAY = 1
    DONE = 2
    NO_SWITCH = 3
    STAYS_CLOSED = 4
    STOPPED = 5


class HomeKind(IntEnum):
    """What a unit finds its bearings by."""

    SWITCH = 0
    STOP = 1
    OPENING_SWITCH = 2


class Stay(IntEnum):
    """Why a loader does not start the application."""

    ASKED = 0
    NO_APPLICATION = 1
    NOT_CONFIRMED = 2
    FLASH_FAILED = 3


class Outcome(IntEnum):
    """What became of a command."""

    DONE = 0
    BUSY = 1
    OUT_OF_RANGE = 2
    NOT_HOMED = 3
    FLASH_FAILED = 4
    BAD_CRC = 5
    NOT_FOR_THIS_UNIT = 6
