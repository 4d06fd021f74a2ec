"""The frames from unit to host."""

from dataclasses import dataclass
from typing import ClassVar

from noctule_gateway.wire.frames.values import I16, NO_LIFE, U8, U16, U24, U32, U48


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


AnySweep = Sweep | Sweep2
UnitFrame = Hello | Status | Clock | Result | Rejected | Settings | Mechanics | Loader | AnySweep
