"""A unit measures itself, order by order: the steps, what ends them early, and what is left to do for the unit then."""

import time
from math import inf

import pytest
from gateway.model_unit import OWN_CALIBRATION, OWN_PLAN, ModelUnit
from gateway.test_command_runner import Desk

from noctule.bounds import UNIT_PLAN
from noctule.cli.command import MEASURE_TIMEOUT_S, SELF_TEST_TIMEOUT_S
from noctule.messages_pb2 import CommandRequest, Measurement, UnitStatus
from noctule_gateway.errors import CommandError
from noctule_gateway.measure.procedure import BACKLASH, COMMANDS, GEAR, SELF_TEST, Procedure, summary
from noctule_gateway.wire import frames
from noctule_gateway.wire.frames import (
    NEVER,
    NO_SLIP,
    NO_TEMPERATURE,
    HomeKind,
    Measure,
    Measured,
    MeasureKind,
    Mechanics,
    Settings,
    State,
)

ASKED = CommandRequest(request_id="a")


def settings(**other: int) -> Settings:
    own = {**vars(OWN_PLAN), **vars(OWN_CALIBRATION), "stored": 1, "temperature_trim": NO_TEMPERATURE}
    return Settings(**{**own, **other})


def idle(state: UnitStatus.State = UnitStatus.STATE_IDLE, firmware: str = "0.5.0") -> UnitStatus:
    return UnitStatus(state=state, firmware=firmware)


def mechanics(kind: int, outcome: int = Measured.DONE) -> Mechanics:
    """One edge up and down, without play."""
    return Mechanics(0, NO_SLIP, kind, outcome, 1, 100, 0, 0, 1, 99, 0, 0, 500, 180, NEVER, NEVER)


class Measures(ModelUnit):
    """Takes so long for each measurement of itself."""

    def __init__(self, takes_s: float = 3.0) -> None:
        super().__init__(knows_turns=True)
        self.takes_s = takes_s
        self._over_s, self._number = 0.0, 0
        self._told = mechanics(0, Measured.NOTHING)

    def _obey(self, order: frames.Order, now_s: float) -> frames.Frame:
        match order:
            case Measure() if now_s < self._over_s:
                return frames.Result(order.request, order.TYPE, frames.Outcome.BUSY)
            case Measure():
                self._over_s, self._told = now_s + self.takes_s, mechanics(order.kind)
            case frames.Stop():
                self._over_s = min(self._over_s, now_s)
        return super()._obey(order, now_s)

    def _answer(self, frame: frames.Frame, now_s: float) -> frames.Frame:
        if isinstance(frame, frames.AskMechanics):
            return Mechanics(**{**vars(self._told), "request": frame.request})
        return super()._answer(frame, now_s)

    def _status(self, request: int, now_s: float) -> frames.Status:
        status = vars(super()._status(request, now_s))
        measures = now_s < self._over_s
        if self._over_s and not measures:
            self._number, self._over_s = self._number + 1, 0.0
        state = State.MEASURING if measures else status["state"]
        return frames.Status(**{**status, "state": state, "flags": status["flags"] | self._number << 4})


def desk_with(unit: ModelUnit) -> Desk:
    desk = Desk(unit, status=idle)
    desk.run(1.0)
    return desk


# ---- The steps ----


def test_each_step_is_given_when_the_one_before_is_over() -> None:
    given: list[frames.Order] = []
    procedure = Procedure(BACKLASH, settings(), idle(), lambda order: given.append(order) or len(given))
    for count in (1, 2, 3):
        assert (len(given), procedure.ticket, procedure.over) == (count, count, False)
        procedure.mechanics_read(mechanics(MeasureKind.PLAY))  # of the step before: this one has not begun
        assert len(given) == count
        procedure.settled()
        procedure.mechanics_read(mechanics(MeasureKind.PLAY, Measured.UNDER_WAY))
        procedure.mechanics_read(mechanics(MeasureKind.ROUND))
        assert len(given) == count
        procedure.mechanics_read(mechanics(MeasureKind.PLAY))
    assert procedure.over and procedure.failure() is None
    assert given == 3 * [Measure(0, MeasureKind.PLAY)]
    (found,) = procedure.measurements(idle())
    assert (found.value, found.verdict) == (0, Measurement.VERDICT_GOOD)


def test_a_self_test_that_can_not_turn_makes_a_ping_and_ends() -> None:
    given: list[frames.Order] = []
    procedure = Procedure(SELF_TEST, settings(), idle(), lambda order: given.append(order) or len(given))
    procedure.settled()
    procedure.mechanics_read(mechanics(MeasureKind.PLAY, Measured.NO_SWITCH))
    procedure.settled()
    procedure.mechanics_read(mechanics(MeasureKind.PING))
    assert procedure.over
    assert given == [Measure(0, MeasureKind.PLAY), Measure(0, MeasureKind.PING)]


@pytest.mark.parametrize(
    ("status", "home", "words"),
    [
        (idle(firmware="0.4.2"), HomeKind.SWITCH, "update it to 0.5"),
        (idle(UnitStatus.STATE_SWEEPING), HomeKind.SWITCH, "busy: stop it"),
        (idle(), HomeKind.STOP, "without a home switch"),
    ],
)
def test_what_can_not_be_measured_now_is_refused(status: UnitStatus, home: int, words: str) -> None:
    with pytest.raises(CommandError, match=words):
        Procedure(GEAR, settings(home=home), status, lambda _: 1)


def test_a_self_test_may_take_as_long_as_its_plan_is_slow() -> None:
    # Three rounds of 2 x 292 degrees at 250 half steps/s or more, and 270 degrees from ping to ping.
    half_steps = 4075.77 / 360
    for top_speed in (50, 100, 600):
        moves_s = (3 * 2 * 292 / max(top_speed, 250) + 270 / top_speed) * half_steps
        limit_s = Procedure(SELF_TEST, settings(top_speed=top_speed), idle(), lambda _: 1).limit_s
        assert 60 < limit_s - moves_s < 300


@pytest.mark.parametrize("name", COMMANDS)
def test_who_asks_waits_longer_than_the_gateway(name: str) -> None:
    slowest = settings(top_speed=int(UNIT_PLAN["top_speed_half_steps_s"].least), ramp_ms=1000)
    limit_s = Procedure(name, slowest, idle(), lambda _: 1).limit_s
    assert limit_s + 10 < (SELF_TEST_TIMEOUT_S if name == SELF_TEST else MEASURE_TIMEOUT_S)


# ---- As a command ----


def test_a_unit_measures_its_play_three_times() -> None:
    desk = desk_with(Measures())
    reply = desk.command(BACKLASH, ASKED)
    desk.run(30.0)
    assert (reply.result(0).done, reply.result(0).detail) == (True, "nothing found wrong")
    assert desk.unit.carried_out == 3 * [Measure(0, MeasureKind.PLAY)]
    assert list(desk.command("status", ASKED).result(0).measurements) == list(reply.result(0).measurements)


def test_it_takes_no_other_order_meanwhile_but_a_stop_and_that_ends_it() -> None:
    desk = desk_with(Measures(takes_s=inf))
    reply = desk.command(BACKLASH, ASKED)
    desk.run(2.0)
    assert "measures itself" in desk.command("home", ASKED).result(0).error
    stop = desk.command("stop", ASKED)
    desk.run(1.0)
    assert "it was stopped" in reply.result(0).error and stop.result(0).done
    assert desk.unit.carried_out == [Measure(0, MeasureKind.PLAY), frames.Stop(0)]


def test_after_a_stop_nothing_of_the_measurement_follows() -> None:
    desk = desk_with(Measures())
    reply = desk.command(BACKLASH, ASKED)
    stop = desk.command("stop", ASKED)  # goes before what waits
    desk.run(5.0)
    assert "it was stopped" in reply.result(0).error and stop.result(0).done
    assert desk.unit.carried_out == [frames.Stop(0)]


def test_a_unit_that_takes_too_long_is_stopped_and_can_be_used_again() -> None:
    unit = Measures(takes_s=inf)
    desk = desk_with(unit)
    reply = desk.command(BACKLASH, ASKED)
    desk.run(2.0)
    desk.commands.advance(time.monotonic() + 90.0)
    assert not reply.done()
    desk.commands.advance(time.monotonic() + 110.0)
    assert "within 102 s, and is stopped" in reply.result(0).error
    desk.run(1.0)
    assert unit.carried_out[-1] == frames.Stop(0)
    unit.takes_s = 1.0
    again = desk.command(BACKLASH, CommandRequest(request_id="b"))
    desk.run(20.0)
    assert again.result(0).done


def test_a_reset_ends_it() -> None:
    desk = desk_with(Measures())
    reply = desk.command(GEAR, ASKED)
    desk.run(1.0)
    desk.commands.unit_was_reset()
    assert "the unit was reset" in reply.result(0).error
    desk.run(5.0)
    assert desk.unit.carried_out == [Measure(0, MeasureKind.TURN)]


@pytest.mark.parametrize(
    ("verdicts", "said"),
    [
        ("GOOD", "nothing found wrong"),
        ("GOOD UNKNOWN", "nothing found wrong; could not be determined: m1"),
        ("UNKNOWN", "could not be determined: m0"),
        ("BAD GOOD UNKNOWN", "not as it should be: m0; could not be determined: m2"),
    ],
)
def test_a_measurement_is_summed_up_in_one_line(verdicts: str, said: str) -> None:
    found = [
        Measurement(name=f"m{number}", verdict=f"VERDICT_{verdict}") for number, verdict in enumerate(verdicts.split())
    ]
    assert summary(found) == said
