"""Keeps one unit at its turns: tells them in its ticks, and when it must be told again. Pure."""

from collections.abc import Sequence
from dataclasses import dataclass

from noctule_gateway.clock.boot_clocks import TickLine
from noctule_gateway.turns.timetable import DRIFTS_S, Crowd, Turn
from noctule_gateway.wire.frames import Hello, Start, Status

RENEWED_AFTER_S = 2.0  # at the earliest: a START takes a share of the line
_RENEWED_WITHIN_S = 60.0  # whatever the unit has made of the last one
_WORSE = 1.5  # two such clocks may just not meet
_NAMED = 5
_PATIENCE_S = 30.0  # a clock takes some seconds to be known well; until then there is nothing to say


@dataclass(frozen=True)
class TickTurns:
    """A unit's turns in its own ticks."""

    tick: int
    period: int


def in_ticks(turn: Turn, line: TickLine) -> TickTurns:
    """The turn that is next where ``line`` begins, and the period."""
    return TickTurns(round(line.tick + _ahead_s(turn, line.utc_s) / line.tick_s), round(turn.period_s / line.tick_s))


def drifted_s(given: TickTurns, turn: Turn, line: TickLine) -> float:
    """By how much a unit that keeps ``given`` pings too late where ``line`` begins; at most half a period."""
    ahead_ticks = (given.tick - line.tick) % given.period
    late_s = ahead_ticks * line.tick_s - _ahead_s(turn, line.utc_s)
    return (late_s + turn.period_s / 2) % turn.period_s - turn.period_s / 2


def _ahead_s(turn: Turn, utc_s: float) -> float:
    return (turn.offset_s - utc_s) % turn.period_s


class TurnKeeper:
    """``turn`` is the unit's in the timetable; None if it needs none."""

    def __init__(self, turn: Turn | Crowd | None) -> None:
        self._turn = turn
        self._given: TickTurns | None = None
        self._given_s = self._met_s = 0.0
        self._out_of_turn_with: Sequence[str] = ()
        self._knows_turns = self._clock_is_good = self._started = False

    def met(self, hello: Hello, now_s: float) -> None:
        """The unit is there, and may have restarted: it may have no turns."""
        self._given, self._met_s = None, now_s
        self._knows_turns, self._clock_is_good = hello.knows_turns, False

    def said(self, status: Status) -> None:
        """What the unit says of itself."""
        self._started = status.started
        if not status.in_turn:
            self._given = None

    def goes_by(self, out_of_turn_with: Sequence[str]) -> None:
        """Its plan is known now: it lets these units hear it out of turn, since the timetable was made for another."""
        self._out_of_turn_with = out_of_turn_with

    def start(self, start: Start, line: TickLine | None, now_s: float) -> Start:
        """``start`` with the unit's turns, or without, where it has none or its clock is not known well enough."""
        self._judge_clock(line)
        if not (isinstance(self._turn, Turn) and line is not None and self._knows_turns and self._clock_is_good):
            self._given = None
            return Start(start.request, start.pause_ms)
        self._given, self._given_s = in_ticks(self._turn, line), now_s
        return Start(start.request, start.pause_ms, self._given.tick % 2**48, self._given.period)

    def look(self, line: TickLine | None, now_s: float) -> bool:
        """Look at the unit's clock; True if the unit must be told its turns again.

        It drifts from them, may have them now, or can't keep them any more.
        """
        if not (isinstance(self._turn, Turn) and self._knows_turns and self._started):
            return False
        if now_s < self._given_s + RENEWED_AFTER_S:
            return False
        self._judge_clock(line)
        if self._given is None or line is None or not self._clock_is_good:
            return (self._given is not None) != self._clock_is_good
        old = now_s > self._given_s + _RENEWED_WITHIN_S
        return old or abs(drifted_s(self._given, self._turn, line)) > DRIFTS_S

    def trouble(self, now_s: float) -> str:
        """Why the unit pings out of turn though others may hear it, for the operator; empty if it does not."""
        if self._started and self._out_of_turn_with:
            named = ", ".join(self._out_of_turn_with[:_NAMED])
            return (
                f"its plan looks further than the site file's, so {named} may hear its pings: "
                "write the plan into the site file and start the gateway again"
            )
        if self._turn is None or self._given is not None or not self._started:
            return ""
        if isinstance(self._turn, Crowd):
            return (
                f"{self._turn.units} units could hear each other, too many for turns, so it pings as it likes: "
                "name their rooms in the site file"
            )
        if not self._knows_turns:
            return "units near it hear its pings, because its firmware knows no turns: update it"
        if self._clock_is_good or now_s < self._met_s + _PATIENCE_S:
            return ""
        return "units near it hear its pings, because its clock is not known well enough for turns: check its line"

    def _judge_clock(self, line: TickLine | None) -> None:
        """Whether the clock is good; one that is good may become worse by half, so that turns don't come and go."""
        if isinstance(self._turn, Turn):
            allowed_s = self._turn.clock_error_s * (_WORSE if self._clock_is_good else 1)
            self._clock_is_good = line is not None and line.error_s <= allowed_s
