"""Commands that an operator gives to a unit by the command noctule, and what is known of the unit."""

import json
import math
import re

import pytest
from sdk.conftest import finish

from noctule import keys
from noctule.messages_pb2 import (
    Calibration,
    CommandReply,
    CommandRequest,
    SweepPlan,
)


@pytest.mark.usefixtures("site")
def test_rpc_prints_the_reply_or_why_it_was_not_done(noctule):
    code, out, _ = finish(noctule("rpc", "room", "u1", "hello", "--json"))
    assert code == 0 and json.loads(out)["status"]["firmware"] == "replay"
    code, out, _ = finish(noctule("rpc", "room", "u1", "status"))
    assert code == 0 and out.startswith("u1: idle\n") and re.search("^  log +1 to 3$", out, re.MULTILINE)
    code, _, err = finish(noctule("rpc", "room", "u1", "configure", "--count", 5))
    assert code == 1 and "configure was not done by unit 'u1': unit 'u1' is a replayed survey" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "dance"))
    assert code == 2 and "No such command 'dance'" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "set_waypoint", "--waypoint", -1))
    assert code == 2 and "'--waypoint': it is '-1': give 0 or more" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "update"))
    assert code == 2 and "Missing option '--image'" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "update", "--image", "no-such.hex"))
    assert code == 1 and err == "noctule: no-such.hex: No such file or directory\n"


@pytest.mark.usefixtures("site")
def test_a_unit_report_that_can_not_be_written_is_printed_and_says_why(noctule, tmp_path):
    code, out, err = finish(noctule("unit-report", "room", "u1", "--output", tmp_path))
    assert code == 1 and "u1: its last sweeps" in out
    assert err == f"noctule: {tmp_path} can't be written: Is a directory\n"


def test_each_command_of_rpc_shows_and_takes_its_own_options_only(noctule):
    joining = {"--connect", "--tls", "--timeout-s", "--help"}
    for command, own in (
        ("calibrate", {"--half-steps-per-turn", "--backlash-half-steps", "--home", "--home-bearing-deg"}),
        ("set_waypoint", {"--waypoint"}),
        ("stop", set()),
    ):
        code, out, _ = finish(noctule("rpc", "attic", "u7", command, "--help"))
        assert code == 0
        assert {line.split()[1] for line in out.splitlines() if line.startswith("│ --")} == own | joining
    code, _, err = finish(noctule("rpc", "attic", "u7", "stop", "--pause-s", 3))
    assert code == 2 and "No such option: --pause-s" in err


def test_rpc_gives_its_options_to_the_unit_in_si_units(noctule, far, open_session, tmp_path):
    asked = {}
    image = tmp_path / "update.hex"
    image.write_bytes(b":00000001FF")

    def answer(query):
        command = str(query.key_expr).rsplit("/", 1)[-1]
        asked[command] = CommandRequest.FromString(query.payload.to_bytes())
        with query:
            query.reply(query.key_expr, CommandReply(done=True).SerializeToString())

    far.answer(keys.rpc("room", "u1", keys.ANY), answer, open_session())
    for command, *options in (
        ("calibrate", "--half-steps-per-turn", 4080.5, "--backlash-half-steps", 7, "--home", "stop"),
        ("calibrate", "--home-bearing-deg", -170),
        ("go_to", "--bearing-deg", 90),
        ("trim_temperature", "--temperature-c", 20.5),
        ("configure", "--pings", 5),
        ("update", "--image", image, "--force"),
    ):
        code, _, err = finish(noctule("rpc", "room", "u1", command, *options))
        assert (code, err) == (0, "")
        if "--half-steps-per-turn" in options:
            measured = Calibration(half_steps_per_turn=4080.5, backlash_half_steps=7, home=Calibration.HOME_STOP)
            assert asked[command].calibration == measured
    assert asked["calibrate"].calibration == Calibration(home_bearing_rad=math.radians(-170))
    assert asked["go_to"].bearing_rad == math.radians(90)
    assert asked["trim_temperature"].temperature_c == 20.5
    assert asked["configure"].plan == SweepPlan(pings=5)
    assert (asked["update"].image, asked["update"].force) == (b":00000001FF", True)
