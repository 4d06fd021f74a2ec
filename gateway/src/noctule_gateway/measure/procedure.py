"""A measurement of one unit: orders given one after the other, each when the one before is over. Reads no clock."""

from collections import deque
from collections.abc import Callable, Iterable

from noctule.messages_pb2 import Measurement, UnitStatus
from noctule_gateway.errors import CommandError
from noctule_gateway.measure import gear, play, self_test
from noctule_gateway.measure.edges import NEEDS_SWITCH, failure
from noctule_gateway.wire.frames import (
    HomeKind,
    Measure,
    Measured,
    MeasureKind,
    Mechanics,
    Order,
    Settings,
    State,
    Status,
)
from noctule_gateway.wire.settings_message import calibration_of

GEAR, BACKLASH, SELF_TEST = "measure_gear", "measure_backlash", "self_test"
COMMANDS = (GEAR, BACKLASH, SELF_TEST)

LIMIT_S = 180.0  # the longest, two turns of 4900 half steps up and down, takes 100 s

_FIRST_FIRMWARE = (0, 5)
_PASSES = {GEAR: 2, BACKLASH: 3}
_KINDS = {GEAR: MeasureKind.TURN, BACKLASH: MeasureKind.PLAY}
_MOVES = (State.HOMING, State.TURNING, State.MEASURING, State.SWEEPING)


class Procedure:
    """The steps of the command ``name`` for a unit that goes by ``settings`` and is in ``status``.

    ``give`` has the unit carry an order out. Raises CommandError if the unit can't do this now.
    """

    def __init__(self, name: str, settings: Settings, status: UnitStatus, give: Callable[[Order], int]) -> None:
        _check(name, settings, status)
        self.name, self.settings = name, settings
        self.found: list[Mechanics] = []
        self.over = False
        self._give = give
        self._steps = deque(_steps(name, settings))
        self._now: Order | None = None
        self._ticket: int | None = None  # of the order that is not settled yet
        self._next()

    def is_mine(self, ticket: int) -> bool:
        """The order of this ticket is the present step's: call settled() with what became of it."""
        return ticket == self._ticket

    def settled(self) -> None:
        """The unit has begun what was ordered."""
        self._ticket = None

    def status_read(self, status: Status) -> None:
        """The unit has told what it is doing."""
        if self._ticket is None and not isinstance(self._now, Measure) and status.state not in _MOVES:
            if status.state == State.FAULT:
                self._skip_to_last()
            self._next()

    def mechanics_read(self, mechanics: Mechanics) -> None:
        """The unit has told what it has measured."""
        if self._ticket is not None or not isinstance(self._now, Measure):
            return
        if mechanics.outcome in (Measured.NOTHING, Measured.UNDER_WAY) or mechanics.kind != self._now.kind:
            return
        self.found.append(mechanics)
        if failure(mechanics) is not None:
            self._skip_to_last()
        self._next()

    def failure(self) -> str | None:
        """Why nothing was measured; None for a self-test, which says so part by part."""
        if self.name == SELF_TEST:
            return None
        return next((why for each in self.found if (why := failure(each)) is not None), None)

    def measurements(self, status: UnitStatus) -> list[Measurement]:
        """What was found, once it is over."""
        if self.name == GEAR:
            return [gear.measurement(self.found, calibration_of(self.settings))]
        if self.name == BACKLASH:
            return [play.measurement(self.found, calibration_of(self.settings))]
        return self_test.measurements(self.found, self.settings, status)

    def _skip_to_last(self) -> None:
        """A part of the way to turn is not there: of what is left, only a ping can be made."""
        self._steps = deque(each for each in self._steps if self.name == SELF_TEST and _is_ping(each))
        while len(self._steps) > 1:
            self._steps.pop()

    def _next(self) -> None:
        if not self._steps:
            self.over = True
            return
        self._now = self._steps.popleft()
        self._ticket = self._give(self._now)


def summary(found: Iterable[Measurement]) -> str:
    """One sentence: what is bad, or that nothing is."""
    wrong = [each.name for each in found if each.verdict == Measurement.VERDICT_BAD]
    return f"not as it should be: {', '.join(wrong)}" if wrong else "nothing found wrong"


def _check(name: str, settings: Settings, status: UnitStatus) -> None:
    version = tuple(int(part) for part in status.firmware.split(".") if part.isdecimal())
    if version < _FIRST_FIRMWARE:
        raise CommandError(f"firmware {status.firmware} can't measure the unit: update it to 0.5 or later")
    if settings.home == HomeKind.STOP and name != SELF_TEST:
        raise CommandError(NEEDS_SWITCH)
    if status.state not in (UnitStatus.STATE_IDLE, UnitStatus.STATE_FAULT):
        raise CommandError("busy: stop it, or wait until it is idle")


def _steps(name: str, settings: Settings) -> list[Order]:
    if name == SELF_TEST:
        return self_test.steps(settings)
    return [Measure(0, _KINDS[name])] * _PASSES[name]


def _is_ping(order: Order) -> bool:
    return isinstance(order, Measure) and order.kind == MeasureKind.PING
