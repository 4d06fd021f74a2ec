"""The command noctule, run as one runs it, against a replayed survey on a real router."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import termios
import time
from contextlib import suppress
from pathlib import Path

import pytest

from noctule import Client, bus, keys, survey
from noctule.messages_pb2 import (
    POSE_STATE_OPEN,
    Calibration,
    CommandReply,
    CommandRequest,
    Contour,
    Pose,
    Reading,
    ServiceStatus,
    Sweep,
    SweepPlan,
    Touch,
    UnitPose,
    UnitStatus,
    Wall,
)
from noctule.replay import Replay

EXAMPLE = Path(__file__).parents[2] / "sdk" / "examples" / "watch_walls.py"
TIMEOUT_S = 120.0
NOCTULE = (sys.executable, "-c", "from noctule.cli import app; app()")


def sweeps(count=3):
    for n in range(count):
        echo = Reading(bearing_rad=0.5, time_of_flight_s=0.01)
        sweep = Sweep(site="room", unit="u1", log_id="a", log_sequence=n + 1, readings=[echo, Reading()])
        sweep.start.FromMilliseconds(1_000_000 + n)
        yield sweep


@pytest.fixture
def survey_file(tmp_path):
    path = tmp_path / "survey.jsonl"
    with path.open("w") as stream:
        survey.write(sweeps(), stream)
    return path


@pytest.fixture
def site(far):
    """A site with one unit that has swept three times, and a contour."""
    schemas = bus.declare_schemas(far.session)
    contour = bus.StatePublisher(far.session, keys.contour("room"), Contour)
    unknown = UnitPose(unit="u2", stated=Pose(sigma_position_m=100), state=POSE_STATE_OPEN, detail="parallel walls")
    walls = [Wall(rho_m=1.5), Wall(rho_m=2, chance=0.997)]
    contour.put(Contour(site="room", version=1, walls=walls, touches=[Touch()], sweeps=3, poses=[unknown]))
    replay = Replay(far.session, "room")
    replay.run(sweeps(), None)
    yield replay
    replay.close()
    contour.close()
    schemas.undeclare()


@pytest.fixture
def start(endpoint):
    """Starts the command; whatever still runs at the end is killed."""
    running = []

    def start(*command, stdin=None, stdout=subprocess.PIPE):
        environment = os.environ | {"NOCTULE_CONNECT": endpoint, "COLUMNS": "200", "PYTHONUNBUFFERED": "1"}
        running.append(
            subprocess.Popen(command, env=environment, stdin=stdin, stdout=stdout, stderr=subprocess.PIPE, text=True)
        )
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.communicate()


@pytest.fixture
def noctule(start):
    return lambda *arguments: start(*NOCTULE, *map(str, arguments))


def finish(process):
    out, err = process.communicate(timeout=TIMEOUT_S)
    return process.returncode, out, err


def line_with(process, text):
    """The first line of output that holds ``text``; the test's own timeout ends the wait."""
    for line in process.stdout:
        if text in line:
            return line
    raise AssertionError(f"it ended without {text!r}: {process.stderr.read()}")


@pytest.mark.usefixtures("site")
def test_units_shows_who_is_alive_and_how_long_its_log_is(noctule):
    code, out, err = finish(noctule("units", "room"))
    assert (code, err) == (0, "")
    row = next(line for line in out.splitlines() if "u1" in line)
    assert "replay" in row and "sweeping" in row and "1-3" in row and time.strftime("%Y-%m-%d") in row


@pytest.mark.usefixtures("site")
def test_units_shows_the_services_of_the_site_too(noctule, far, open_session, known):
    status = bus.StatePublisher(far.session, keys.service_status("room", "m1"), ServiceStatus)
    status.put(ServiceStatus(site="room", name="m1", role="mapper", detail="the last contour stands"))
    known(open_session(), status.key)
    _, out, _ = finish(noctule("units", "room"))
    assert any("m1" in line and "mapper" in line and "the last contour stands" in line for line in out.splitlines())
    code, _, err = finish(noctule("units", "room", "--watch"))
    assert code == 2 and "needs a terminal" in err


def test_units_shows_what_a_gateway_says_as_text_whatever_it_holds(noctule, far, open_session, known):
    status = bus.StatePublisher(far.session, keys.unit_status("room", "u1"), UnitStatus)
    status.put(UnitStatus(site="room", unit="u1", detail="no answer on [fe80::1] [/b] \x1b[31m"))
    known(open_session(), status.key)
    code, out, err = finish(noctule("units", "room"))
    assert (code, err) == (0, "")
    assert "[fe80::1]" in out and "[/b]" in out and "\\x1b[31m" in out and "\x1b" not in out
    process = noctule("watch", "room")
    assert line_with(process, "[fe80::1]").rstrip().endswith("[/b] \\x1b[31m")


@pytest.mark.usefixtures("site")
def test_units_of_a_site_file_shows_those_that_nobody_serves(noctule, tmp_path):
    path = tmp_path / "room.toml"
    unit = '[[unit]]\nname = "u{0}"\nserial = {0}\naddress = "socket://127.0.0.1:{0}"\npose = "key"\n'
    path.write_text('site = "room"\n' + unit.format(1) + unit.format(7))
    code, out, _ = finish(noctule("units", path))
    assert code == 0
    shown = next(line for line in out.splitlines() if "u1" in line)
    assert "sweeping" in shown and re.search(r"just now|\d+ s ago", shown)  # its last sweep
    missing = next(line for line in out.splitlines() if "u7" in line)
    assert "none" in missing and "not served" in missing


@pytest.mark.usefixtures("site")
def test_units_cuts_no_word_on_a_narrow_terminal(start):
    ours, theirs = os.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    process = start("env", "--unset=COLUMNS", *NOCTULE, "units", "room", stdin=theirs, stdout=theirs)
    os.close(theirs)
    shown = b""
    with suppress(OSError):  # so Linux says that nobody holds the other end any more
        while more := os.read(ours, 65536):
            shown += more
    os.close(ours)
    assert finish(process)[0] == 0
    words = re.sub(r"\x1b\[[\d;]*m", "", shown.decode())
    assert "sweeping" in words and "replay" in words and re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d", words)
    assert "\u2026" not in words and max(map(len, words.splitlines())) <= 80
    assert "A wider terminal, or --json, shows also: " in words


@pytest.mark.usefixtures("router")
def test_units_of_an_empty_site_asks_for_the_gateway(noctule):
    code, _, err = finish(noctule("units", "hall"))
    assert code == 1 and "site 'hall' has no units on the bus: is its gateway up?\n" in err


@pytest.mark.usefixtures("site")
def test_who_mistypes_a_site_is_told_which_there_are(noctule):
    code, _, err = finish(noctule("units", "rom"))
    assert code == 1 and err.endswith("is its gateway up? Sites on the bus: room.\n")
    code, _, err = finish(noctule("log", "rom", "u1"))
    assert code == 1 and err.endswith("correct the name. Sites on the bus: room.\n")
    process = noctule("watch", "rom")
    assert "site 'rom' yet. Sites on the bus: room." in process.stderr.readline()


@pytest.mark.usefixtures("site")
def test_units_are_json_lines_on_demand(noctule):
    code, out, _ = finish(noctule("units", "room", "--json"))
    (row,) = map(json.loads, out.splitlines())
    assert code == 0
    assert (row["unit"], row["served"], row["status"]["log_head"]) == ("u1", True, "3")


def test_without_a_router_a_command_says_so_and_fails(noctule, endpoint):
    code, _, err = finish(noctule("units", "room"))
    assert code == 1
    start_one = "start one, such as noctule-gateway run SITE.toml --data FOLDER, or name another endpoint"
    assert err == f"noctule: no router answers at {endpoint}: {start_one}\n"


@pytest.mark.usefixtures("site")
def test_log_prints_a_survey_from_a_sequence_on(noctule):
    code, out, _ = finish(noctule("log", "room", "u1", "--from", 2))
    assert code == 0
    assert [json.loads(line)["log_sequence"] for line in out.splitlines()] == ["2", "3"]
    code, _, err = finish(noctule("log", "room", "u1", "--from", 4))
    assert code == 1 and err == "noctule: unit 'u1' has no sweep 4 yet: its log ends at 3\n"
    code, _, err = finish(noctule("log", "room", "u9"))
    assert code == 1 and "no gateway serves unit 'u9'" in err


@pytest.mark.usefixtures("site")
def test_schema_lists_the_messages_and_shows_one(noctule):
    code, out, _ = finish(noctule("schema"))
    assert code == 0 and "noctule.v1.Sweep" in out.splitlines()
    code, out, _ = finish(noctule("schema", "noctule.v1.Reading"))
    assert code == 0 and 'name: "time_of_flight_s"' in out and "pose" not in out
    code, _, err = finish(noctule("schema", "noctule.v1.Swoop"))
    assert code == 1 and err == "noctule: no message is named noctule.v1.Swoop: did you mean noctule.v1.Sweep?\n"
    code, _, err = finish(noctule("schema", "Conture"))
    assert code == 1 and err == "noctule: no message is named Conture: did you mean noctule.v1.Contour?\n"


def test_what_can_not_be_read_or_written_is_told_before_a_router_is_looked_for(noctule, tmp_path):
    code, _, err = finish(noctule("replay", tmp_path / "none.jsonl", "--site", "room"))
    assert code == 1 and err == f"noctule: {tmp_path / 'none.jsonl'}: No such file or directory\n"
    code, _, err = finish(noctule("record", "room", tmp_path / "sweeps.csv"))
    assert code == 2 and "is neither .jsonl nor .mcap" in err
    code, _, err = finish(noctule("record", "room", tmp_path / "none" / "sweeps.jsonl"))
    assert code == 1 and "there is no folder" in err


@pytest.mark.usefixtures("site")
def test_rpc_prints_the_reply_or_why_it_was_not_done(noctule):
    code, out, _ = finish(noctule("rpc", "--json", "room", "u1", "hello"))
    assert code == 0 and json.loads(out)["status"]["firmware"] == "replay"
    code, out, _ = finish(noctule("rpc", "room", "u1", "status"))
    assert code == 0 and out.startswith("u1: sweeping\n") and re.search("^  log +1 to 3$", out, re.MULTILINE)
    code, _, err = finish(noctule("rpc", "room", "u1", "configure", "--count", 5))
    assert code == 1 and "unit 'u1' did not configure: unit 'u1' is a replayed survey" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "dance"))
    assert code == 2 and "No such command 'dance'" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "set_waypoint", "--waypoint", -1))
    assert code == 2 and "'--waypoint': Input should be greater than or equal to 0" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "update"))
    assert code == 2 and "give --image build/update.hex" in err
    code, _, err = finish(noctule("rpc", "room", "u1", "update", "--image", "no-such.hex"))
    assert code == 1 and err == "noctule: no-such.hex: No such file or directory\n"


@pytest.mark.usefixtures("site")
def test_a_unit_report_that_can_not_be_written_is_printed_and_says_why(noctule, tmp_path):
    code, out, err = finish(noctule("unit-report", "room", "u1", "--output", tmp_path / "none" / "u1.txt"))
    assert code == 1 and "u1: its last sweeps" in out
    assert err == f"noctule: {tmp_path}/none/u1.txt can't be written: No such file or directory\n"


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


def test_watch_shows_statuses_contours_and_sweeps_until_it_is_told_to_stop(site, noctule):
    process = noctule("watch", "room")
    line_with(process, "u1       sweeping, log at 3")
    line_with(process, "contour  1: 2 walls (1 from one place), 0 cylinders, 1 touches, 3 sweeps")
    line_with(process, "u2       pose unknown: parallel walls")
    site.run(sweeps(1), None)
    assert "1 echoes of 2 readings" in line_with(process, "u1       sweep 4")
    process.send_signal(signal.SIGTERM)
    assert finish(process)[0] == 0


def test_watch_ends_quietly_when_nobody_reads_it_any_more(site, noctule):
    process = noctule("watch", "room")
    line_with(process, "contour  1")
    process.stdout.close()
    site.run(sweeps(1), None)
    assert process.wait(20) == 0
    assert process.stderr.read() == ""


@pytest.mark.usefixtures("site")
def test_watch_prints_json_lines_on_demand(noctule):
    process = noctule("watch", "room", "--json")
    shown = json.loads(line_with(process, "map/contour"))
    assert (shown["key"], shown["message"]) == (keys.contour("room"), "noctule.v1.Contour")
    assert shown["value"]["walls"][0]["rho_m"] == 1.5


@pytest.mark.parametrize("name", ["out.jsonl", "out.mcap"])
def test_record_goes_on_where_the_file_ends(site, noctule, tmp_path, name):
    out = tmp_path / name
    journal = out if out.suffix == ".jsonl" else tmp_path / "out.mcap.jsonl"
    for total, new in ((3, 3), (5, 2)):
        process = noctule("record", "room", out)
        lines = total if journal == out else new
        while process.poll() is None and (not journal.exists() or journal.read_bytes().count(b"\n") < lines):
            time.sleep(0.02)  # a file tells nobody that it has grown
        process.send_signal(signal.SIGINT)
        code, _, err = finish(process)
        assert code == 0, err
        site.run(sweeps(2), None)
    assert [sweep.log_sequence for sweep in survey.read(out)] == [1, 2, 3, 4, 5]


FAILING = """
import sys, threading, time
from noctule.cli import app

def fail():
    while threading.excepthook is threading.__excepthook__:
        time.sleep(0.01)
    raise BaseException("as Zenoh panics")

threading.Thread(target=fail, name="part").start()
app()
"""


@pytest.mark.parametrize("command", ["record", "watch"])
def test_a_command_ends_with_the_reason_when_one_of_its_threads_does(start, tmp_path, command):
    """It waits for a router, which never comes, and would wait on."""
    process = start(sys.executable, "-c", FAILING, command, "room", *[tmp_path / "out.jsonl"][: command == "record"])
    code, _, err = finish(process)
    assert code == 70
    assert "part failed, and with it the program" in err and "as Zenoh panics" in err


def test_replay_is_the_router_itself_and_ends_when_its_readers_have_read_it(noctule, endpoint, survey_file, collected):
    process = noctule(
        "replay", survey_file, "--site", "room", "--speed", "max", "--listen", endpoint, "--exit-when-done"
    )
    with Client("room", [endpoint]) as client:
        client.on_alive(lambda unit, _alive: collected.add(unit))
        collected.wait_for(len)
        records = client.log("u1", 1)
        assert records is not None
        assert [sweep.log_sequence for sweep in records.sweeps] == [1, 2, 3]
        status = ServiceStatus(name="mapper")
        status.cursors.add(unit="u1", log_id=records.log_id, log_sequence=3)
        shown = bus.StatePublisher(client.session, keys.service_status("room", "mapper"), ServiceStatus)
        shown.put(status)
        assert finish(process)[0] == 0


def test_replay_fails_when_nobody_reads_it_in_time(noctule, endpoint, survey_file):
    command = ("replay", survey_file, "--site", "room", "--speed", "1000", "--listen", endpoint)
    code, _, err = finish(noctule(*command, "--exit-when-done", "--timeout", 0.2))
    assert code == 1 and "after 0.2 s no service shows that it has read all" in err


@pytest.mark.parametrize("speed", ["0", "-1", "nan", "fast"])
def test_replay_refuses_a_speed_that_is_none(noctule, survey_file, speed):
    code, _, err = finish(noctule("replay", survey_file, "--site", "room", "--speed", speed))
    assert code == 2 and "is neither a number above 0 nor max" in err


def test_the_example_of_an_extra_service_tells_of_walls_and_sweeps(site, start, endpoint):
    process = start(sys.executable, str(EXAMPLE), "room", endpoint)
    assert line_with(process, "wall") == "walls [1.5, 2.0] m away\n"
    site.run(sweeps(1), None)
    assert line_with(process, "u1") == "u1: 2 readings\n"
