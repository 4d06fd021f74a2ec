"""The command noctule, run as one runs it, against a replayed survey on a real router."""

import json
import os
import re
import signal
import sys
import termios
import time
from contextlib import suppress
from pathlib import Path

import pytest
from sdk.conftest import NOCTULE, finish, line_with, sweeps

from noctule import bus, keys
from noctule.messages_pb2 import (
    ServiceStatus,
    UnitStatus,
)

EXAMPLE = Path(__file__).parents[2] / "sdk" / "examples" / "watch_walls.py"


@pytest.mark.usefixtures("site")
def test_units_shows_who_is_alive_and_how_long_its_log_is(noctule):
    code, out, err = finish(noctule("units", "room"))
    assert (code, err) == (0, "")
    row = next(line for line in out.splitlines() if "u1" in line)
    assert "replay" in row and "idle" in row and "1-3" in row and time.strftime("%Y-%m-%d") in row


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
    assert "idle" in shown and re.search(r"just now|\d+ s ago", shown)  # its last sweep
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
    assert "idle" in words and "replay" in words and re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d", words)
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
    code, _, err = finish(noctule("rpc", "room", "u2", "stop"))
    assert code == 1 and err.endswith("correct the name. Units of site 'room': u1.\n")
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
    code, _, err = finish(noctule("unit-report", "room", "u1", "--output", tmp_path / "none" / "u1.txt"))
    assert code == 1 and "there is no folder" in err


def test_watch_shows_statuses_contours_and_sweeps_until_it_is_told_to_stop(site, noctule):
    process = noctule("watch", "room")
    line_with(process, "u1       idle, log at 3")
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
    code, _, err = finish(process)
    assert (code, err) == (0, "")


@pytest.mark.usefixtures("site")
def test_watch_prints_json_lines_on_demand(noctule):
    process = noctule("watch", "room", "--json")
    shown = json.loads(line_with(process, "map/contour"))
    assert (shown["key"], shown["message"]) == (keys.contour("room"), "noctule.v1.Contour")
    assert shown["value"]["walls"][0]["rho_m"] == 1.5


FAILING = """
import sys, threading, time
from noctule.__main__ import program

def fail():
    while threading.excepthook is threading.__excepthook__:
        time.sleep(0.01)
    raise BaseException("as Zenoh panics")

threading.Thread(target=fail, name="part").start()
program()
"""


@pytest.mark.parametrize("command", ["record", "watch"])
def test_a_command_ends_with_the_reason_when_one_of_its_threads_does(start, tmp_path, command):
    """It waits for a router, which never comes, and would wait on."""
    process = start(sys.executable, "-c", FAILING, command, "room", *[tmp_path / "out.jsonl"][: command == "record"])
    code, _, err = finish(process)
    assert code == 70
    assert "part failed, and with it the program" in err and "as Zenoh panics" in err


def test_the_example_of_an_extra_service_tells_of_walls_and_sweeps(site, start, endpoint):
    process = start(sys.executable, str(EXAMPLE), "room", endpoint)
    assert line_with(process, "wall") == "walls [1.5, 2.0] m away\n"
    site.run(sweeps(1), None)
    assert line_with(process, "u1") == "u1: 2 readings\n"
