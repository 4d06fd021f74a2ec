"""What a link has to tell its caller."""

from dataclasses import dataclass

from noctule_gateway.clock.regression import Exchange
from noctule_gateway.errors import CommandError, WrongUnitError
from noctule_gateway.wire.frames import AnySweep, Hello, Loader, Mechanics, Order, Status


@dataclass(frozen=True)
class Identified:
    """The unit is the one expected. ``rebooted``: under another boot than at the last HELLO, or it is the first."""

    hello: Hello
    rebooted: bool


@dataclass(frozen=True)
class Refused:
    """Who answers is not the unit expected."""

    error: WrongUnitError


@dataclass(frozen=True)
class InLoader:
    """The unit is the one expected, but its application does not run: it sits in its loader."""

    loader: Loader


@dataclass(frozen=True)
class Silent:
    """The unit has stopped answering."""


@dataclass(frozen=True)
class ClockRead:
    """A CLOCK exchange, the bytes' own time on a 115200 baud line taken out."""

    exchange: Exchange


@dataclass(frozen=True)
class StatusRead:
    """What the unit says of itself."""

    status: Status


@dataclass(frozen=True)
class MechanicsRead:
    """What the unit has found out about its motor and gears, after each change."""

    mechanics: Mechanics


@dataclass(frozen=True)
class SettingsRead:
    """Link.settings are known: after the unit was identified, and again after each order that changes them."""


@dataclass(frozen=True)
class SweepRead:
    """A sweep to commit: call Link.committed() then, or Link.failed()."""

    sweep: AnySweep


@dataclass(frozen=True)
class OrderSettled:
    """What became of an order given by Link.order(): ``error`` is None if it was carried out."""

    order: Order
    ticket: int
    error: CommandError | None


@dataclass(frozen=True)
class LinkCounts:
    """What a link has counted since it was made, under the names of the bus."""

    frames_read: int
    frames_bad: int
    frames_unknown: int
    sweeps_repeated: int
    requests_unanswered: int


Event = (
    Identified
    | Refused
    | InLoader
    | Silent
    | ClockRead
    | StatusRead
    | MechanicsRead
    | SettingsRead
    | SweepRead
    | OrderSettled
)
