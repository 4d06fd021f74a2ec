"""A measurement of one unit: orders given one after the other, each when the one before is over. Reads no clock."""

from collections import deque
from collections.abc import Callable, Iterable, Sequence

from noctule.messages_pb2 import Measurement, UnitStatus
from noctule_gateway.errors import CommandError
from noctule_gateway.measure import gear, play, self_test
from noctule_gateway.measure.edges import NEEDS_SWITCH, failure
from noctule_gateway.wire.frames import (
    GoTo,
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

# How far the motor turns at most, in half steps: firmware/README.md, MEASURE.
_HOMING_SPEED = 250  # half steps/s
_HOMING = 4900  # a turn of any gear that a unit takes, and some more
_TO_AND_FRO = {MeasureKind.PLAY: 2 * 4400 // 8, MeasureKind.TURN: 2 * 4900}
_ROUND = 2 * 4400 * 292 // 360
_GO_TO = 500  # 30 degrees from one to the next, and the play
_STEP_S = 3.0  # until the gateway knows that a step is over: it asks once a second, and over a bad line again
_SPARE_S = 60.0

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
        self.limit_s = longest_s(self._steps, settings)
        self._now: Order | None = None
        self.ticket: int | None = None  # of the order that is not settled yet
        self._next()

    def settled(self) -> None:
        """The unit has begun what was ordered under ``ticket``."""
        self.ticket = None

    def status_read(self, status: Status) -> None:
        """The unit has told what it is doing."""
        if self.ticket is None and not isinstance(self._now, Measure) and status.state not in _MOVES:
            if status.state == State.FAULT:
                self._skip_to_last()
            self._next()

    def mechanics_read(self, mechanics: Mechanics) -> None:
        """The unit has told what it has measured."""
        if self.ticket is not None or not isinstance(self._now, Measure):
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
        self.ticket = self._give(self._now)


def longest_s(steps: Iterable[Order], settings: Settings) -> float:
    """How long a sound unit may take for ``steps`` at most: some go at the speed of its plan."""
    return _SPARE_S + _HOMING / _HOMING_SPEED + sum(_STEP_S + _moves_s(step, settings) for step in steps)


def summary(found: Sequence[Measurement]) -> str:
    """One line: what is bad, or that nothing is, and what could not be determined."""
    wrong, unknown, good = (
        [each.name for each in found if each.verdict == verdict]
        for verdict in (Measurement.VERDICT_BAD, Measurement.VERDICT_UNKNOWN, Measurement.VERDICT_GOOD)
    )
    parts = [f"not as it should be: {', '.join(wrong)}"] if wrong else ["nothing found wrong"] if good else []
    return "; ".join([*parts, f"could not be determined: {', '.join(unknown)}"] if unknown else parts)


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


def _moves_s(step: Order, settings: Settings) -> float:
    """How long the motor turns at most, in a unit that is at home."""
    match step:
        case Measure(kind=MeasureKind.PLAY | MeasureKind.TURN):
            return _TO_AND_FRO[MeasureKind(step.kind)] / _HOMING_SPEED
        case Measure(kind=MeasureKind.ROUND):
            half_steps, speed = _ROUND, max(settings.top_speed, _HOMING_SPEED)
        case GoTo():
            half_steps, speed = _GO_TO, settings.top_speed
        case _:
            return 0.0
    return half_steps / speed + 4 * settings.ramp_ms / 1000


def _is_ping(order: Order) -> bool:
    return isinstance(order, Measure) and order.kind == MeasureKind.PING
