"""The audit log: nothing in it can be altered without a trace, and no disk keeps a command from its unit."""

import json
import logging
import os
import resource
import shutil
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path

import pytest
import zenoh
from gateway.serving import FIXED, SITE, running, site_file
from hypothesis import given
from hypothesis import strategies as st
from system.processes import wait_until
from typer.testing import CliRunner

from noctule.caller import Who
from noctule.client import Client
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway import service
from noctule_gateway.audit import allowance, audit_file, audit_log, lines
from noctule_gateway.audit.allowance import (
    CALLERS,
    COMMANDS,
    DAY_S,
    KEPT_AT_LEAST_S,
    REFUSALS,
    Allowance,
    Keeping,
    Sum,
)
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.audit.look import AuditLook, copy_audit, look_at_audit
from noctule_gateway.bus.recorded_commands import RecordedCommands
from noctule_gateway.cli import app
from noctule_gateway.errors import AuditError

ANNA = Who("operator.anna.g1", signed=True)


def close(log: AuditLog) -> None:
    log.end()
    log.close(time.monotonic() + 60)


def record(folder: Path, count: int, keeping: Keeping = COMMANDS) -> AuditLog:
    """What one run of a gateway records."""
    log = AuditLog(folder, {"site": "house"}, keeping)
    for number in range(count):
        log.append({"event": "given", "command": "stop", "request_id": f"r{number}"}).result(10)
    close(log)
    return log


def look(folder: Path) -> AuditLook:
    (found,) = look_at_audit(folder)
    return found


def facts(folder: Path, family: str = "audit") -> list[lines.Facts]:
    return [json.loads(line) for _, path in lines.files(folder, family) for line in path.read_bytes().splitlines()]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three runs with three commands each, a file each."""
    folder = tmp_path_factory.mktemp("audit")
    for _ in range(3):
        record(folder, 3)
    return folder


@pytest.fixture
def copy(recorded: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recorded, tmp_path / "copy"))


def test_lines_are_one_chain_over_all_files_and_restarts(recorded: Path) -> None:
    assert [number for number, _ in lines.files(recorded)] == [1, 2, 3]
    assert [each["number"] for each in facts(recorded)] == list(range(1, 13))
    assert str(look(recorded)) == "audit log: 12 sound lines, numbers 1 to 12; all is sound"


@given(file=st.integers(1, 3), at=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7))
def test_no_bit_of_it_can_flip_without_a_trace(recorded: Path, file: int, at: float, bit: int) -> None:
    path = recorded / lines.file_name(file)
    sound = path.read_bytes()
    changed = bytearray(sound)
    changed[int(at * len(sound))] ^= 1 << bit
    try:
        path.write_bytes(changed)
        found = look(recorded)
    finally:
        path.write_bytes(sound)
    # The last line's end could also be missing because it is being written.
    assert found.trouble or (found.cut, found.sound, file) == (1, 11, 3)


@pytest.mark.parametrize(
    ("alter", "words"),
    [
        (lambda them: them.pop(2), "audit-2.jsonl, line 3 was changed, or the line before it was changed or taken out"),
        (lambda them: them.insert(1, them.pop(2)), "audit-2.jsonl, line 2 was changed, or the line before it"),
        (lambda them: them.insert(2, them[1]), "audit-2.jsonl, line 3 was changed, or the line before it"),
        (lambda them: them.pop(), "audit-3.jsonl, line 1 does not go on from the file before: lines at its end are"),
        (lambda them: them.clear(), "audit-3.jsonl, line 1 does not go on from the file before: lines at its end are"),
    ],
)
def test_a_line_that_was_taken_out_or_moved_shows(copy: Path, alter, words: str) -> None:
    path = copy / lines.file_name(2)
    them = path.read_bytes().splitlines(keepends=True)
    alter(them)
    path.write_bytes(b"".join(them))
    assert words in look(copy).trouble


def test_a_file_that_is_missing_shows_but_the_oldest_may_be_deleted(copy: Path) -> None:
    (copy / lines.file_name(2)).rename(copy / "kept")
    assert look(copy).trouble == "it was altered: audit-2.jsonl is missing"
    (copy / lines.file_name(1)).unlink()
    assert look(copy).trouble == ""


def test_a_line_that_a_crash_has_cut_is_no_alteration_and_the_next_run_goes_on(copy: Path) -> None:
    path = copy / lines.file_name(3)
    path.write_bytes(path.read_bytes()[:-20])
    assert (look(copy).cut, look(copy).trouble) == (1, "")
    record(copy, 2)
    assert str(look(copy)) == (
        "audit log: 14 sound lines, numbers 1 to 14, 1 unfinished at the end of a file, as a crash leaves them; "
        "all is sound"
    )


SMALL = replace(COMMANDS, max_file_bytes=2_000, max_bytes=10_000, burst_bytes=10**6)


def sizes(folder: Path, family: str = "audit") -> list[int]:
    return [path.stat().st_size for _, path in lines.files(folder, family)]


def test_its_size_is_bounded_and_the_oldest_files_go_first(tmp_path: Path) -> None:
    log = record(tmp_path, 300, SMALL)
    assert sum(sizes(tmp_path)) <= 2 * 10_000 and max(sizes(tmp_path)) <= 2_000 + 300
    assert lines.files(tmp_path)[0][0] > 1
    found = look(tmp_path)
    assert (found.trouble, found.last) == ("", log.recorded)
    assert found.first > 1


def test_a_file_of_the_last_thirty_days_stays_until_twice_the_size_and_an_older_one_goes(tmp_path: Path) -> None:
    record(tmp_path, 70, SMALL)
    assert 10_000 < sum(sizes(tmp_path)) <= 20_000
    assert lines.files(tmp_path)[0][0] == 1
    for _, path in lines.files(tmp_path):
        os.utime(path, (0, time.time() - KEPT_AT_LEAST_S - 60))
    record(tmp_path, 1, SMALL)
    assert sum(sizes(tmp_path)) <= 10_000
    assert (look(tmp_path).trouble, lines.files(tmp_path)[0][0] > 1) == ("", True)


@pytest.mark.parametrize("keeping", [COMMANDS, REFUSALS])
def test_no_flood_fills_a_log_within_thirty_days(keeping: Keeping) -> None:
    most = Sum(0.0)
    for number in range(20):
        made_up = f"{number}" + "\U0001f987" * 64  # JSON makes twelve bytes of a bat
        most.add({"event": "refused", "unit": made_up, "command": made_up, "who": '"' * number + "\x01" * 64})
    longest_sum = len(json.dumps(most.facts())) + 200
    assert longest_sum * DAY_S / allowance.SUM_UP_EVERY_S <= keeping.bytes_per_day / 2  # the common budget pays
    days = KEPT_AT_LEAST_S / DAY_S
    most_written = keeping.burst_bytes + days * keeping.bytes_per_day + longest_sum
    assert most_written + keeping.max_file_bytes <= keeping.max_bytes


def test_a_flood_is_summed_up_and_washes_out_nothing_that_was_recorded_before(tmp_path: Path) -> None:
    keeping = replace(REFUSALS, max_bytes=60_000, burst_bytes=10_000, bytes_per_day=1_000, max_file_bytes=5_000)
    now_s = 0.0
    log = AuditLog(tmp_path, {}, keeping, now_s=lambda: now_s)
    log.append({"event": "refused", "who": "the first"}).result(10)
    refusals = 15_000
    for number in range(refusals):
        now_s = number * KEPT_AT_LEAST_S / refusals
        log.append({"event": "refused", "unit": "u1", "command": "home", "who": f"session {number % 2}"})
    close(log)
    assert log.lost == 0
    assert sum(sizes(tmp_path, "refused")) <= keeping.max_bytes
    recorded = facts(tmp_path, "refused")
    assert recorded[1]["who"] == "the first"
    sums = [each for each in recorded if each["event"] == "summed up"]
    whole = [each for each in recorded if each["event"] == "refused"]
    assert len(whole) + sum(each["count"] for each in sums) == 1 + refusals
    assert sum(each["count"] for each in sums) == log.summed_up
    assert {kind["who"] for each in sums for kind in each["kinds"]} == {"session 0", "session 1"}
    assert str(look(tmp_path)).startswith("log of refusals: ") and look(tmp_path).trouble == ""


def test_a_command_that_is_only_counted_is_carried_out_all_the_same(tmp_path: Path) -> None:
    log = AuditLog(tmp_path, {}, replace(COMMANDS, burst_bytes=0, bytes_per_day=0))
    reply: Future[CommandReply] = Future()
    reply.set_result(CommandReply(done=True))
    given = RecordedCommands(lambda *_: reply, log, "u1").carry_out("stop", CommandRequest(request_id="r1"), ANNA)
    assert given.result(10).done
    close(log)
    assert facts(tmp_path)[1]["kinds"] == [
        {"event": "given", "unit": "u1", "command": "stop", "who": "operator.anna.g1", "count": 1},
    ]


def carried_out(*_: object) -> Future[CommandReply]:
    reply: Future[CommandReply] = Future()
    reply.set_result(CommandReply(done=True))
    return reply


class Flooded:
    """A log in which anna sets 2 waypoints a second, in a time of the test's own."""

    def __init__(self, folder: Path, keeping: Keeping = COMMANDS) -> None:
        self._folder, self._now_s, self._given = folder, 0.0, 0
        self._log = AuditLog(folder, {}, keeping, now_s=lambda: self._now_s)
        self._commands = RecordedCommands(carried_out, self._log, "u1")

    def give(self, command: str, who: Who) -> None:
        self._given += 1
        request = CommandRequest(request_id=f"r{self._given:06}", waypoint=3)
        assert self._commands.carry_out(command, request, who).result(60).done

    def flood(self, count: int, who: Who = ANNA, command: str = "set_waypoint") -> None:
        for _ in range(count):
            self._now_s += 0.5
            self.give(command, who)

    def end(self) -> list[lines.Facts]:
        close(self._log)
        return facts(self._folder)


# Small, so that a flood of some hundred commands is enough: 16 shares of half of it are 2 kB each, and a line in 20 s.
TIGHT = replace(COMMANDS, max_bytes=10_000_000, burst_bytes=64_000, bytes_per_day=3_456_000)


def test_a_flood_that_lasts_has_both_lines_of_a_command_or_none(tmp_path: Path) -> None:
    flooded = Flooded(tmp_path, TIGHT)
    flooded.flood(2000)
    recorded = flooded.end()
    given = [each["request_id"] for each in recorded if each["event"] == "given"]
    done = [each["request_id"] for each in recorded if each["event"] == "done"]
    assert given == done
    assert sum(request_id > "r001000" for request_id in given) >= 5  # later, too, as the budget is refilled


@pytest.mark.parametrize(
    ("command", "who"),
    [
        ("stop", Who("operator.bert.g1", signed=True)),
        ("update", ANNA),
        ("calibrate", Who("session 1", signed=False)),
    ],
)
def test_a_flood_by_one_operator_hides_no_other_ones_command_and_no_grave_one(
    tmp_path: Path, command: str, who: Who
) -> None:
    flooded = Flooded(tmp_path, TIGHT)
    flooded.flood(500)
    flooded.give(command, who)
    recorded = flooded.end()
    (given,) = [each for each in recorded if each["event"] == "given" and each["command"] == command]
    assert given["who"] == who.name
    assert [each["event"] for each in recorded if each.get("request_id") == given["request_id"]] == ["given", "done"]


def test_callers_who_make_up_names_share_one_budget_and_an_operator_who_comes_late_has_an_own_one() -> None:
    now_s = 0.0
    budgets = Allowance(TIGHT, lambda: now_s)

    def line(who: str, signed: bool) -> lines.Facts:
        return {"event": "given", "who": who, "signed": signed, "command": "stop"}

    while budgets.admit(line("anna", True)):
        pass
    strangers = sum(budgets.admit(line(f"session {number}", False)) is not None for number in range(1000))
    assert 5 <= strangers <= 15  # 2 kB, of which RESERVE_BYTES stay
    for number in range(CALLERS + 5):
        assert (budgets.admit(line(f"operator {number}", True)) is not None) == (number < CALLERS - 1)
    now_s = KEPT_AT_LEAST_S
    while budgets.admit(line("anna", True)):
        pass
    assert budgets.admit(line("who comes late", True)) is not None
    assert budgets.admit(line("anna", True)) is None


def test_a_sum_says_how_many_others_there_were_beside_the_kinds_that_it_names() -> None:
    told = Sum(0.0)
    for number in range(8):
        told.add({"event": "given", "unit": f"u{number}", "command": "stop", "who": "anna"})
    line = told.facts()
    assert (line["count"], line["others"]) == (8, 3)
    assert sum(kind["count"] for kind in line["kinds"]) == 5


def test_a_copy_of_a_running_gateways_log_ends_with_a_whole_line(copy: Path, tmp_path: Path) -> None:
    with (copy / lines.file_name(3)).open("ab") as file:
        file.write(b'{"number":13,"ti')
    out = tmp_path / "out"
    out.mkdir()
    copy_audit(copy, out)
    assert (look(out).sound, look(out).cut, look(out).trouble) == (12, 0, "")


@pytest.mark.parametrize(("keeping", "what"), [(COMMANDS, "commands"), (REFUSALS, "refusals")])
def test_where_it_can_not_be_written_the_command_is_carried_out_and_the_status_says_what_to_do(
    tmp_path: Path, keeping: Keeping, what: str
) -> None:
    folder = tmp_path / "data"
    log = AuditLog(folder, {}, keeping)
    with pytest.raises(AuditError, match="No such file or directory"):
        log.append({"event": "given"}).result(10)
    assert log.detail.startswith(f"{what} are not recorded (") and "make room there" in log.detail
    assert log.lost == 1
    folder.mkdir()
    log.append({"event": "given"}).result(10)
    assert (log.detail, log.recorded) == ("", 2)
    close(log)


def test_the_status_of_a_gateway_tells_troubles_of_both_logs(tmp_path: Path, router: zenoh.Session) -> None:
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))
    data = tmp_path / "data"
    with running(path, data, router) as gateway, Client(SITE, session=router) as client:
        for name in ("audit-1.jsonl", "refused-1.jsonl"):
            (data / name).symlink_to(name)  # "Too many levels of symbolic links"
        client.command("u1", "stop", CommandRequest(request_id="r1"), 60)
        assert "used for another command" in client.command("u1", "home", CommandRequest(request_id="r1"), 60).error

        def told() -> str:
            gateway.report()
            return gateway.summary

        wait_until(lambda: "; refusals are not recorded (" in told(), "the refusals' trouble was not told")
        assert "; commands are not recorded (" in told()


def test_a_line_that_a_full_disk_has_cut_short_is_taken_back(tmp_path: Path) -> None:
    log = AuditLog(tmp_path, {})
    log.append({"event": "given"}).result(10)
    size = (tmp_path / lines.file_name(1)).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 10, hard))
    try:
        with pytest.raises(AuditError, match="File too large"):
            log.append({"event": "given"}).result(10)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (tmp_path / lines.file_name(1)).stat().st_size == size
    log.append({"event": "given"}).result(10)
    close(log)
    assert (look(tmp_path).sound, look(tmp_path).cut, look(tmp_path).trouble) == (4, 0, "")


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """A disk that answers, where the logs are concerned, once the event is set."""
    answers, fsync = threading.Event(), os.fsync

    def hang(file: int) -> None:
        if Path(f"/proc/self/fd/{file}").readlink().suffix == ".jsonl":
            answers.wait(30)
        fsync(file)

    monkeypatch.setattr(audit_file.os, "fsync", hang)
    monkeypatch.setattr(audit_log, "WAIT_S", 0.05)
    yield answers
    answers.set()


def test_a_disk_that_hangs_holds_a_command_up_for_a_moment_only(tmp_path: Path, hanging: threading.Event) -> None:
    begun: list[str] = []

    def unit(name: str, request: CommandRequest) -> Future[CommandReply]:
        begun.append(name)
        reply: Future[CommandReply] = Future()
        reply.set_result(CommandReply(request_id=request.request_id, done=True))
        return reply

    log = AuditLog(tmp_path, {})
    reply = RecordedCommands(unit, log, "u1").carry_out("stop", CommandRequest(request_id="r1"), ANNA)
    assert reply.result(10).done
    assert (begun, log.lost) == (["stop"], 1)
    assert log.detail.startswith("commands are recorded late, if at all: the disk of")
    hanging.set()
    close(log)
    assert log.detail == ""
    assert [each["event"] for each in facts(tmp_path)] == ["file begun", "given", "done"]  # late, but there


@pytest.mark.parametrize("whole_disk", [False, True])
def test_a_gateway_ends_in_time_though_its_disk_hangs(
    tmp_path: Path,
    router: zenoh.Session,
    hanging: threading.Event,
    monkeypatch: pytest.MonkeyPatch,
    whole_disk: bool,
) -> None:
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))
    with running(path, tmp_path / "data", router) as gateway, Client(SITE, session=router) as client:
        client.command("u1", "stop", CommandRequest(request_id="r1"), 60)
        client.command("u1", "home", CommandRequest(request_id="r1"), 60)  # refused
        monkeypatch.setattr(service, "_CLOSED_WITHIN_S", 0.1, raising=False)
        if whole_disk:  # the log of sweeps too
            monkeypatch.setattr(audit_file.os, "fsync", lambda _: hanging.wait(30))
        begun_s = time.monotonic()
        gateway.close()
        assert time.monotonic() - begun_s < 4.0  # one after the other, each log took 2 s
        assert not hanging.is_set()
        hanging.set()


def test_a_command_is_recorded_before_it_is_begun_with_who_gave_it_and_then_with_its_outcome(tmp_path: Path) -> None:
    known_when_begun: list[lines.Facts] = []
    reply: Future[CommandReply] = Future()

    def unit(_name: str, _request: CommandRequest) -> Future[CommandReply]:
        known_when_begun.extend(facts(tmp_path))
        return reply

    log = AuditLog(tmp_path, {"site": "house"})
    commands = RecordedCommands(unit, log, "u1")
    request = CommandRequest(request_id="r1", image=b":00000001FF\n", force=True)
    given = commands.carry_out("update", request, ANNA)
    wait_until(lambda: known_when_begun, "the command was not begun")
    reply.set_result(CommandReply(request_id="r1", error="the image was not taken: it is not signed"))
    assert not given.result(10).done
    commands.carry_out("status", CommandRequest(request_id="r2"), ANNA)  # changes nothing
    close(log)
    begun, record_, outcome = facts(tmp_path)
    assert known_when_begun[:2] == [begun, record_]
    assert begun["site"] == "house"
    told = {key: value for key, value in record_.items() if key not in ("number", "time", "hash")}
    assert told == {
        "event": "given",
        "who": "operator.anna.g1",
        "signed": True,
        "unit": "u1",
        "command": "update",
        "request_id": "r1",
        "arguments": {
            "force": True,
            # sha256sum of the twelve bytes
            "image": "12 bytes, SHA-256 9e2df0a1190a1205c098889c455e5b76c4df18b5ccac2b7605da1575f05b64c5",
        },
    }
    assert (outcome["event"], outcome["request_id"]) == ("failed", "r1")
    assert outcome["error"] == "the image was not taken: it is not signed"


def test_what_a_client_has_made_up_begins_no_line_of_the_programs_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    reply: Future[CommandReply] = Future()
    reply.set_result(CommandReply(done=True))
    log = AuditLog(tmp_path, {})
    forged = Who("session x\nERROR all is lost", signed=False)
    with caplog.at_level(logging.INFO):
        given = RecordedCommands(lambda *_: reply, log, "u1").carry_out(
            "stop", CommandRequest(request_id="r\nERROR too"), forged
        )
        assert given.result(10).done
    close(log)
    assert not any(line.startswith("ERROR") for line in caplog.text.splitlines())
    assert (look(tmp_path).sound, look(tmp_path).trouble) == (3, "")


def test_check_reads_the_audit_log_too_and_ends_with_status_1_where_it_was_altered(tmp_path: Path) -> None:
    log = record(tmp_path, 3)
    (tmp_path / "u1.sqlite").touch()
    text = (tmp_path / lines.file_name(1)).read_text()
    (tmp_path / lines.file_name(1)).write_text(text.replace('"r1"', '"r9"'))
    run = CliRunner().invoke(app, ["check", str(tmp_path)])
    assert run.exit_code == 1
    assert "audit log: 3 sound lines, numbers 1 to 4; it was altered: audit-1.jsonl, line 3 was changed" in run.output
    assert log.recorded == 4
