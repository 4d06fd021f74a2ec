"""A unit's self-test by the real firmware: what its gateway names for each broken part, and how it ends early."""

from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit
from system.lockstep import CLEAN, Lockstep

from noctule.messages_pb2 import CommandReply, CommandRequest, Measurement
from noctule.site import Sensor, Unit, UnknownPose
from noctule_gateway.link.events import Event, Identified, MechanicsRead, OrderSettled, SettingsRead, StatusRead
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.status import unit_status
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.unit.command_runner import CommandRunner
from noctule_gateway.update.admission import Admission
from noctule_gateway.wire import frames

UNIT = Unit("u1", 1, "", UnknownPose(), Sensor(), None, False, 0.0)
AT_REST = Wanted(plan=None, start=frames.Start(0, 0), running=False)
HALF_STEP_DEG = 360 / 4075.7728
# When the gateway stops it, by the default plan and by one of 100 half steps/s: gateway/README.md, "What a unit
# measures of itself".
WITHIN_S, SLOW_WITHIN_S = 195.0, 285.0
WALL = "[[wall]]\nfrom_m = [1.0, -9.0]\nto_m = [1.0, 9.0]\n"  # in front: no echo from behind


class Desk(Lockstep):
    """Gives commands to the unit through its link."""

    def __init__(self, unit: SteppedUnit) -> None:
        link = Link(serial=1, wanted=AT_REST, first_request=0)
        self.known = UnitState()
        self.runner = CommandRunner(
            link, self._status, lambda _image, _again: None, Admission(), lambda done: done(None)
        )
        super().__init__(unit, link, CLEAN, seed=1)

    def begin(self, name: str) -> Future[CommandReply]:
        reply: Future[CommandReply] = Future()
        self.runner.begin(name, CommandRequest(request_id=name), reply)
        return reply

    def reply(self, name: str) -> CommandReply:
        reply = self.begin(name)
        self.wait_for(reply.done, WITHIN_S)
        return reply.result()

    def _status(self):
        status = unit_status.message(self.known, UNIT)
        status.clock_error_s = 1e-4
        return status

    def _take(self, events: list[Event]) -> None:
        super()._take(events)
        for event in events:
            match event:
                case Identified(hello, rebooted):
                    if rebooted:
                        self.runner.unit_was_reset()
                    self.known = self.known.identified(hello)
                case StatusRead(status):
                    self.known = self.known.said(status)
                    self.runner.status_read(status)
                case MechanicsRead(mechanics):
                    self.runner.mechanics_read(mechanics)
                case SettingsRead():
                    self.runner.settings_read()
                case OrderSettled():
                    self.runner.settled(event)


@contextmanager
def desk_with(tmp_path: Path, motor: str = "", sensor: str = ""):
    room = tmp_path / "room.toml"
    stand = "[unit]\nposition_m = [0.0, 0.0]\n"
    room.write_text(f'name = "bench"\n[motor]\n{motor}\n[sensor]\n{sensor}\n{WALL}{stand}')
    with stepped_unit("--room", str(room)) as unit:
        desk = Desk(unit)
        desk.run(4.0)  # its clock is known, and its thermometer's first mean
        yield unit, desk


def verdicts(reply: CommandReply, verdict: int) -> dict[str, str]:
    """The figures of this verdict, with their words."""
    return {each.name: each.words for each in reply.measurements if each.verdict == verdict}


def bad(reply: CommandReply) -> dict[str, str]:
    return verdicts(reply, Measurement.VERDICT_BAD)


def test_nothing_is_wrong_with_a_sound_unit(tmp_path: Path) -> None:
    with desk_with(tmp_path) as (unit, desk):
        reply = desk.reply("self_test")
        assert (reply.done, reply.detail) == (True, "nothing found wrong")
        names = ["supply_v", "chip_temperature_c", "home_switch", "backlash_half_steps", "round_half_steps_lost"]
        assert [each.name for each in reply.measurements] == [*names, "echo_lag_s", "no_echo_s", "clock_drift"]
        assert list(verdicts(reply, Measurement.VERDICT_GOOD)) == [each.name for each in reply.measurements]
        desk.run(1.0)
        assert not unit.truth["coils_on"]
        assert desk.tally.arrived == []  # no sweep was made
        assert list(desk.reply("status").measurements) == list(reply.measurements)


@pytest.mark.parametrize(
    ("fault", "part", "words"),
    [
        ({"kind": "home_stuck_open"}, "home_switch", "no home switch was found"),
        ({"kind": "home_stuck_closed"}, "home_switch", "does not open"),
        ({"kind": "motor_stuck"}, "home_switch", "no home switch was found"),
        ({"kind": "motor_loses_steps", "probability": 0.002}, "round_half_steps_lost", "the motor loses steps"),
        ({"kind": "sensor_missing"}, "echo_lag_s", "never rose by itself"),
        ({"kind": "sensor_stuck_high"}, "echo_lag_s", "never rose by itself"),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
def test_a_broken_part_is_named_with_what_to_do(tmp_path: Path, fault: dict, part: str, words: str) -> None:
    with desk_with(tmp_path) as (unit, desk):
        unit.inject(**fault)
        reply = desk.reply("self_test")
        assert reply.done and part in reply.detail
        assert words in bad(reply)[part]
        desk.run(1.0)
        assert not unit.truth["coils_on"]


def test_play_that_nobody_has_told_and_a_sensor_that_latches_are_named(tmp_path: Path) -> None:
    with desk_with(tmp_path, f"backlash_deg = {20 * HALF_STEP_DEG}", "no_echo_ms = 1e9") as (_unit, desk):
        found = bad(desk.reply("self_test"))
        assert "calibrate --backlash-half-steps 20" in found["backlash_half_steps"]
        assert "fit the transistor at P1.6" in found["no_echo_s"]


@pytest.mark.parametrize(("lag_ms", "words"), [(2.3, "2.30"), (42.0, "42.00")])
def test_the_kind_of_sensor_shows_in_its_lag(tmp_path: Path, lag_ms: float, words: str) -> None:
    with desk_with(tmp_path, sensor=f"echo_lag_ms = {lag_ms}\nno_echo_ms = 60.0") as (_unit, desk):
        told = verdicts(desk.reply("self_test"), Measurement.VERDICT_GOOD)
        assert words[:3] in told["echo_lag_s"] and "60 ms" in told["no_echo_s"]
        # gateway/README.md, Turns to speak: of 12 or 42 ms, not in one room with ordinary ones.
        assert ("must not share a room" in told["echo_lag_s"]) == (lag_ms > 2.5)


@pytest.mark.parametrize("command", ["measure_gear", "measure_backlash"])
@pytest.mark.parametrize(
    ("fault", "words"), [("home_stuck_open", "no home switch was found"), ("home_stuck_closed", "does not open")]
)
def test_a_measurement_that_needs_home_fails_with_its_reason(tmp_path, command, fault, words) -> None:
    with desk_with(tmp_path) as (unit, desk):
        unit.inject(fault)
        reply = desk.reply(command)
        assert not reply.done and words in reply.error


def test_a_stop_ends_it_and_meanwhile_no_other_order_is_taken(tmp_path: Path) -> None:
    with desk_with(tmp_path) as (unit, desk):
        reply = desk.begin("self_test")
        desk.run(15.0)
        for command in ("start", "single", "configure", "measure_gear"):
            assert "measures itself" in desk.reply(command).error
        assert desk.reply("settings").HasField("settings")
        assert desk.reply("stop").done
        assert (reply.result().done, reply.result().error) == (False, "it was stopped")
        desk.run(3.0)
        assert not unit.truth["coils_on"]
        assert desk.reply("measure_backlash").done


def test_a_reset_in_its_midst_ends_it(tmp_path: Path) -> None:
    with desk_with(tmp_path) as (unit, desk):
        reply = desk.begin("self_test")
        desk.run(10.0)
        unit.inject("reset_pin")
        desk.wait_for(reply.done, 30.0)
        assert reply.result().error == "the unit was reset"


def test_a_unit_with_a_slow_plan_has_the_time_that_it_takes(tmp_path: Path) -> None:
    with desk_with(tmp_path) as (_unit, desk):
        desk.carry_out(frames.Configure(0, -24576, 4096, 13, 60, 100, 100, 20, 1), 5.0)
        reply = desk.begin("self_test")
        desk.wait_for(reply.done, SLOW_WITHIN_S)
        assert (reply.result().done, reply.result().detail) == (True, "nothing found wrong")


def test_a_unit_with_a_stop_tests_what_needs_no_switch(tmp_path: Path) -> None:
    with desk_with(tmp_path, 'home = "none"\nstop_deg = 160.0') as (_unit, desk):
        home = frames.Calibrate(0, round(4075.7728 * 256), 0, frames.HomeKind.STOP, round(-160 / 360 * 65536))
        desk.carry_out(home, 5.0)
        reply = desk.reply("self_test")
        without_switch = ["home_switch", "backlash_half_steps", "round_half_steps_lost"]
        said = f"nothing found wrong; could not be determined: {', '.join(without_switch)}"
        assert (reply.done, reply.detail) == (True, said)
        assert list(verdicts(reply, Measurement.VERDICT_UNKNOWN)) == without_switch
        assert "without a home switch" in desk.reply("measure_gear").error


def test_firmware_that_can_not_measure_is_named(tmp_path: Path) -> None:
    with desk_with(tmp_path) as (_unit, desk):
        assert desk.known.hello is not None
        desk.known = desk.known.identified(replace(desk.known.hello, version_minor=4))
        assert "firmware 0.4.0 can't measure the unit: update it" in desk.reply("self_test").error
