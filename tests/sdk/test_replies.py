"""Replies of units as they are shown: in words, angles in degrees as they are given."""

import math

import pytest

from noctule.cli.replies import DONE, lines
from noctule.messages_pb2 import Calibration, CommandReply, SweepPlan, UnitSettings, UnitStatus


@pytest.mark.parametrize("command", DONE)
def test_a_command_that_was_done_is_one_line(command: str) -> None:
    (line,) = lines("u7", command, CommandReply(done=True, status=UnitStatus(state=UnitStatus.STATE_IDLE)))
    assert line.removesuffix("; idle now") == f"u7: {DONE[command]}"


@pytest.mark.parametrize(("command", "is_shown"), [("store", True), ("stop", False), ("home", False), ("go_to", False)])
def test_the_units_state_is_shown_with_what_is_over(command: str, is_shown: bool) -> None:
    (line,) = lines("u7", command, CommandReply(done=True, status=UnitStatus(state=UnitStatus.STATE_IDLE)))
    assert line.endswith("; idle now") == is_shown


def test_an_update_says_from_which_version_to_which() -> None:
    assert lines("u7", "update", CommandReply(done=True, detail="0.3.0 -> 0.9.0")) == ["u7: done; 0.3.0 -> 0.9.0"]


def test_settings_are_in_the_units_of_measure_of_the_command_line() -> None:
    plan = SweepPlan(first_bearing_rad=math.radians(-135), bearing_step_rad=math.radians(22.5), count=13, settle_s=0.02)
    plan.top_speed_half_steps_s = 600
    calibration = Calibration(half_steps_per_turn=4080.5, home=Calibration.HOME_STOP, home_bearing_rad=math.radians(90))
    shown = lines(
        "u7", "settings", CommandReply(settings=UnitSettings(plan=plan, calibration=calibration, stored=True))
    )
    assert [line.split(maxsplit=1) if n else line for n, line in enumerate(shown)] == [
        "u7: its settings",
        ["first", "bearing    -135.00 degrees"],
        ["bearing", "step     22.50 degrees"],
        ["count", "13"],
        ["top", "speed        600 half steps/s"],
        ["settle", "0.02 s"],
        ["half", "steps per turn 4080.5"],
        ["home", "stop"],
        ["home", "bearing     90.00 degrees"],
        ["in", "flash         yes"],
    ]


def test_a_status_shows_what_was_counted_and_nothing_that_was_not() -> None:
    status = UnitStatus(state=UnitStatus.STATE_FAULT, detail="the motor is stuck", serial=7, boot=3, firmware="0.6.0")
    status.counters["frames_bad"] = 4
    status.counters["frames_lost"] = 0
    shown = lines("u7", "status", CommandReply(status=status))
    assert shown[0] == "u7: fault"
    assert "  detail           the motor is stuck" in shown
    assert "  frames bad       4" in shown
    assert not any("frames lost" in line for line in shown)


def test_of_a_unit_that_was_never_heard_only_what_its_gateway_knows_is_shown() -> None:
    status = UnitStatus(state=UnitStatus.STATE_DISCONNECTED, detail="no answer on /dev/ttyUSB0", clock_error_s=3600)
    assert lines("u7", "status", CommandReply(status=status)) == [
        "u7: disconnected",
        "  detail           no answer on /dev/ttyUSB0",
        "  log              empty",
    ]
