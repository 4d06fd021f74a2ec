"""The audit log: nothing in it can be altered without a trace, and no disk keeps a command from its unit."""

import logging
import shutil
from concurrent.futures import Future
from pathlib import Path

import pytest
from gateway.audited import ANNA, close, facts, look, record
from hypothesis import given
from hypothesis import strategies as st
from system.processes import wait_until
from typer.testing import CliRunner

from noctule.caller import Who
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.audit import lines
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.audit.look import copy_audit
from noctule_gateway.bus.recorded_commands import RecordedCommands
from noctule_gateway.cli import app


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


def test_a_copy_of_a_running_gateways_log_ends_with_a_whole_line(copy: Path, tmp_path: Path) -> None:
    with (copy / lines.file_name(3)).open("ab") as file:
        file.write(b'{"number":13,"ti')
    out = tmp_path / "out"
    out.mkdir()
    copy_audit(copy, out)
    assert (look(out).sound, look(out).cut, look(out).trouble) == (12, 0, "")


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
    assert not given.result(60).done
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
        assert given.result(60).done
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
