"""The frames between host and unit as dataclasses: the table of firmware/README.md, "Frames".

Integers are the wire's own: ticks of 0.25 us, bearings of 1/65536 turn, reading offsets of 16 ticks.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, ClassVar, NamedTuple


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

PROTOCOL = 1
NO_SERIAL = 0xFFFFFFFF
NO_WAYPOINT = 0xFFFF
NO_TEMPERATURE = 0x7FFF
FIRST_NO_ECHO = 0xFFFFF0  # from here on an echo field names a kind of no echo
MAX_READINGS = 64
MAX_REQUEST = 255


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


class Outcome(IntEnum):
    """What became of a command."""

    DONE = 0
    BUSY = 1
    OUT_OF_RANGE = 2
    NOT_HOMED = 3


# ---- Host to unit --------------------------------------------------------------------------------


@dataclass(frozen=True)
class AskHello:
    TYPE: ClassVar = 0x01
    request: U8
    protocol: U8 = PROTOCOL


@dataclass(frozen=True)
class AskStatus:
    TYPE: ClassVar = 0x02
    request: U8


@dataclass(frozen=True)
class AskClock:
    TYPE: ClassVar = 0x03
    request: U8


@dataclass(frozen=True)
class Configure:
    TYPE: ClassVar = 0x04
    request: U8
    first_bearing: I16
    bearing_step: U16
    count: U8
    ping_interval_ms: U16
    top_speed: U16  # half steps/s
    ramp_ms: U16
    settle_ms: U16


@dataclass(frozen=True)
class Start:
    TYPE: ClassVar = 0x05
    request: U8
    pause_ms: U16


@dataclass(frozen=True)
class Stop:
    TYPE: ClassVar = 0x06
    request: U8


@dataclass(frozen=True)
class Single:
    TYPE: ClassVar = 0x07
    request: U8


@dataclass(frozen=True)
class Home:
    TYPE: ClassVar = 0x08
    request: U8


@dataclass(frozen=True)
class SetWaypoint:
    TYPE: ClassVar = 0x09
    request: U8
    waypoint: U16


@dataclass(frozen=True)
class Ack:
    TYPE: ClassVar = 0x10
    boot: U16
    sequence: U32


# ---- Unit to host --------------------------------------------------------------------------------


@dataclass(frozen=True)
class Hello:
    TYPE: ClassVar = 0x81
    request: U8
    protocol: U8
    serial: U32
    version_major: U8
    version_minor: U8
    version_patch: U8
    boot: U16
    reset_cause: U8
    ring_capacity: U16

    @property
    def version(self) -> str:
        """The firmware's version as people write it."""
        return f"{self.version_major}.{self.version_minor}.{self.version_patch}"


@dataclass(frozen=True)
class Status:
    TYPE: ClassVar = 0x82
    request: U8
    state: U8
    flags: U8
    fault: U8
    waypoint: U16
    bearing: I16
    ring_used: U16
    sweeps_waiting: U8
    sweeps_made: U32
    sweeps_resent: U16
    frames_bad: U16
    frames_unknown: U16
    bytes_lost: U16
    echo_faults: U16
    tick: U48

    @property
    def homed(self) -> bool:
        """The unit knows where its bearing is."""
        return bool(self.flags & 0x01)

    @property
    def started(self) -> bool:
        """The unit goes on sweeping until STOP."""
        return bool(self.flags & 0x02)


@dataclass(frozen=True)
class Clock:
    TYPE: ClassVar = 0x83
    request: U8
    received: U48
    sent: U48


@dataclass(frozen=True)
class Result:
    TYPE: ClassVar = 0x84
    request: U8
    command: U8
    result: U8


@dataclass(frozen=True)
class Rejected:
    TYPE: ClassVar = 0x85
    reason: U8
    type: U8


@dataclass(frozen=True)
class Reading:
    bearing: I16
    offset: U24
    echo: U24


@dataclass(frozen=True)
class Sweep:
    TYPE: ClassVar = 0x90
    boot: U16
    sequence: U32
    start: U48
    waypoint: U16
    temperature: I16  # 0.01 degrees C
    flags: U8
    readings: tuple[Reading, ...]


Enquiry = AskHello | AskStatus | AskClock
Order = Configure | Start | Stop | Single | Home | SetWaypoint
HostFrame = Enquiry | Order | Ack
UnitFrame = Hello | Status | Clock | Result | Rejected | Sweep
Frame = HostFrame | UnitFrame
