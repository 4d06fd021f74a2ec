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
class AskMechanics:
    TYPE: ClassVar = 0x15
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
    pings: U8  # a reading: 1, 3 or 5


@dataclass(frozen=True)
class Start:
    """Without a period the unit pings as soon as it is ready; the frame is then as older firmware knows it."""

    TYPE: ClassVar = 0x05
    request: U8
    pause_ms: U16
    turn: int = 0  # U48: the tick of one of its turns
    period: int = 0  # U32: ticks from turn to turn


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
class GoTo:
    TYPE: ClassVar = 0x0A
    request: U8
    bearing: I16


@dataclass(frozen=True)
class Calibrate:
    TYPE: ClassVar = 0x0B
    request: U8
    half_steps_per_turn: U32  # in 1/256
    backlash: U8  # half steps
    home: U8  # a HomeKind
    home_bearing: I16


@dataclass(frozen=True)
class TrimTemperature:
    TYPE: ClassVar = 0x0C
    request: U8
    temperature: I16  # 0.01 degrees C


@dataclass(frozen=True)
class Store:
    TYPE: ClassVar = 0x0D
    request: U8


@dataclass(frozen=True)
class Reset:
    TYPE: ClassVar = 0x0E
    request: U8


@dataclass(frozen=True)
class AskSettings:
    TYPE: ClassVar = 0x0F
    request: U8


@dataclass(frozen=True)
class Measure:
    TYPE: ClassVar = 0x14
    request: U8
    kind: U8  # a MeasureKind


@dataclass(frozen=True)
class Ack2:
    """The acknowledgement of a Sweep2, or of any sweep of a unit of protocol 2."""

    TYPE: ClassVar = 0x10
    boot: U16
    sequence: U32


@dataclass(frozen=True)
class Update:
    TYPE: ClassVar = 0x11
    request: U8
    serial: U32


@dataclass(frozen=True)
class Ack:
    """The acknowledgement of a Sweep, by its whole name: no unit takes it for that of a sweep of its own."""

    TYPE: ClassVar = 0x12
    boot: U16
    sequence: U32
    serial: U32
    life: U32


@dataclass(frozen=True)
class For:
    """An order that names its unit: another one, whose plug is where this one's was, refuses it."""

    TYPE: ClassVar = 0x13
    serial: U32
    life: U32
    order: "Order"


# ---- Host to loader ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Put:
    TYPE: ClassVar = 0x20
    request: U8
    offset: U16
    data: bytes


@dataclass(frozen=True)
class Program:
    TYPE: ClassVar = 0x21
    request: U8
    page: U8
    crc: U32


@dataclass(frozen=True)
class Install:
    TYPE: ClassVar = 0x22
    request: U8


@dataclass(frozen=True)
class Run:
    TYPE: ClassVar = 0x23
    request: U8


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
    reset_note: U8
    ring_capacity: U16
    life: int = NO_LIFE  # U32, from protocol 3 on

    @property
    def boot_of_life(self) -> int:
        """The boot's number, and the unit's life above it: boot numbers begin again in a chip that was erased."""
        return self.life << 16 | self.boot

    @property
    def version(self) -> str:
        """The firmware's version as people write it."""
        return f"{self.version_major}.{self.version_minor}.{self.version_patch}"

    @property
    def knows_mechanics(self) -> bool:
        """Its firmware answers MECHANICS."""
        return (self.version_major, self.version_minor) >= (0, 5)

    @property
    def knows_turns(self) -> bool:
        """Its firmware takes a START that says when it may ping."""
        return (self.version_major, self.version_minor) >= (0, 5)


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
    temperature: I16  # 0.01 degrees C, of the chip
    stack_free: U8  # bytes
    tick: U48

    @property
    def homed(self) -> bool:
        """The unit knows where its bearing is."""
        return bool(self.flags & 0x01)

    @property
    def started(self) -> bool:
        """The unit goes on sweeping until STOP."""
        return bool(self.flags & 0x02)

    @property
    def slipped(self) -> bool:
        """The latest check found the bearings off: the motor may slip again."""
        return bool(self.flags & 0x04)

    @property
    def mechanics_number(self) -> int:
        """Another one than last time: MECHANICS has changed. Always 0 in firmware before 0.5, which has none."""
        return self.flags >> 4

    @property
    def in_turn(self) -> bool:
        """It pings at its turns only."""
        return bool(self.flags & 0x08)


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
class Settings:
    TYPE: ClassVar = 0x86
    request: U8
    stored: U8
    first_bearing: I16
    bearing_step: U16
    count: U8
    ping_interval_ms: U16
    top_speed: U16
    ramp_ms: U16
    settle_ms: U16
    pings: U8
    half_steps_per_turn: U32  # in 1/256
    backlash: U8
    home: U8
    home_bearing: I16
    temperature_trim: I16  # 0.01 K


@dataclass(frozen=True)
class Mechanics:
    TYPE: ClassVar = 0x87
    request: U8
    slip: I16  # a bearing, or NO_SLIP
    kind: U8  # of the latest measurement, a MeasureKind
    outcome: U8  # a Measured
    ups: U8  # how many edges of the home switch it saw on the way up, at these half steps of the motor
    up_1: I16
    up_2: I16
    up_3: I16
    downs: U8
    down_1: I16
    down_2: I16
    down_3: I16
    top: I16
    supply: I16  # VDD above the reference, in 1/512 of that
    lag: U24  # of a ping's ECHO, in ticks, or NEVER
    width: U24


@dataclass(frozen=True)
class Loader:
    TYPE: ClassVar = 0x8A
    request: U8
    protocol: U8
    serial: U32
    hardware: U8
    loader: U8
    reason: U8  # a Stay
    application_major: U8
    application_minor: U8
    application_patch: U8


@dataclass(frozen=True)
class Reading:
    bearing: I16
    offset: U24
    echo: U24


@dataclass(frozen=True)
class Sweep2:
    """A sweep of protocol 2. It does not name its unit; a unit's ring may hold some after its update."""

    TYPE: ClassVar = 0x90
    life: ClassVar = NO_LIFE
    boot: U16
    sequence: U32
    start: U48
    waypoint: U16
    temperature: I16  # 0.01 degrees C
    flags: U8
    readings: tuple[Reading, ...]
    slipped: ClassVar = False  # no firmware of then checks its bearings
    suspect_before: ClassVar = 0

    @property
    def boot_of_life(self) -> int:
        """As in the HELLO of then."""
        return self.boot


@dataclass(frozen=True)
class Sweep:
    TYPE: ClassVar = 0x91
    boot: U16
    sequence: U32
    serial: U32
    life: U32
    start: U48
    waypoint: U16
    temperature: I16  # 0.01 degrees C
    flags: U8
    readings: tuple[Reading, ...]

    @property
    def boot_of_life(self) -> int:
        """As in Hello."""
        return self.life << 16 | self.boot

    @property
    def slipped(self) -> bool:
        """The unit's latest check found its bearings off: the motor may slip again."""
        return bool(self.flags & 0x02)

    @property
    def suspect_before(self) -> int:
        """So many sweeps before this one were made with bearings that a check found to be off."""
        return self.flags >> 2


Enquiry = AskHello | AskStatus | AskClock | AskSettings | AskMechanics
Order = (
    Configure
    | Start
    | Stop
    | Single
    | Home
    | SetWaypoint
    | GoTo
    | Calibrate
    | TrimTemperature
    | Store
    | Reset
    | Update
    | Measure
)
LoaderOrder = Put | Program | Install | Run
AnySweep = Sweep | Sweep2
HostFrame = Enquiry | Order | For | LoaderOrder | Ack | Ack2
UnitFrame = Hello | Status | Clock | Result | Rejected | Settings | Mechanics | Loader | AnySweep
Frame = HostFrame | UnitFrame
