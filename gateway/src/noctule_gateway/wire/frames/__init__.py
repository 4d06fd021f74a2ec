"""The frames between host and unit as dataclasses: the table of firmware/README.md, "Frames".

Integers are the wire's own: ticks of 0.25 us, bearings of 1/65536 turn, reading offsets of 16 ticks.
"""

# ruff: noqa: F401  what is imported here is imported from here

from noctule_gateway.wire.frames.from_unit import (
    AnySweep,
    Clock,
    Hello,
    Loader,
    Mechanics,
    Reading,
    Rejected,
    Result,
    Settings,
    Status,
    Sweep,
    Sweep2,
    UnitFrame,
)
from noctule_gateway.wire.frames.to_unit import (
    Ack,
    Ack2,
    AskClock,
    AskHello,
    AskMechanics,
    AskSettings,
    AskStatus,
    Calibrate,
    Configure,
    Enquiry,
    For,
    GoTo,
    Home,
    HostFrame,
    Install,
    LoaderOrder,
    Measure,
    Order,
    Program,
    Put,
    Reset,
    Run,
    SetWaypoint,
    Single,
    Start,
    Stop,
    Store,
    TrimTemperature,
    Update,
)
from noctule_gateway.wire.frames.values import (
    FIRST_NO_ECHO,
    MAX_PUT_BYTES,
    MAX_READINGS,
    MAX_REQUEST,
    NEVER,
    NO_LIFE,
    NO_SERIAL,
    NO_SLIP,
    NO_TEMPERATURE,
    NO_WAYPOINT,
    PROTOCOL,
    PROTOCOLS,
    HomeKind,
    Measured,
    MeasureKind,
    NoEcho,
    Outcome,
    State,
    Stay,
    Wire,
)

Frame = HostFrame | UnitFrame
