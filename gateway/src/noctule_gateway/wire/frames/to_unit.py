"""The frames from host to unit, and to its loader."""

from dataclasses import dataclass
from typing import ClassVar

from noctule_gateway.wire.frames.values import I16, PROTOCOL, U8, U16, U32


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


# ---- To its loader


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
HostFrame = Enquiry | Order | For | LoaderOrder | Ack | Ack2
