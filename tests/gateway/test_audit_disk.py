"""No disk keeps a command from its unit, nor a gateway from its end: what can't be recorded is said in the status."""

import os
import resource
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest
import zenoh
from gateway.audited import ANNA, close, facts, look
from gateway.serving import FIXED, SITE, running, site_file
from system.processes import wait_until

from noctule.client import Client
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway import service
from noctule_gateway.audit import audit_file, audit_log, lines
from noctule_gateway.audit.allowance import COMMANDS, REFUSALS, Keeping
from noctule_gateway.audit.audit_log import AuditLog
from noctule_gateway.bus.recorded_commands import RecordedCommands
from noctule_gateway.errors import AuditError


@pytest.mark.parametrize(("keeping", "what"), [(COMMANDS, "commands"), (REFUSALS, "refusals")])
def test_where_it_can_not_be_written_the_command_is_carried_out_and_the_status_says_what_to_do(
    tmp_path: Path, keeping: Keeping, what: str
) -> None:
    folder = tmp_path / "data"
    log = AuditLog(folder, {}, keeping)
    with pytest.raises(AuditError, match="No such file or directory"):
        log.append({"event": "given"}).result(60)
    assert log.detail.startswith(f"{what} are not recorded (") and "make room there" in log.detail
    assert log.lost == 1
    folder.mkdir()
    log.append({"event": "given"}).result(60)
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
    log.append({"event": "given"}).result(60)
    size = (tmp_path / lines.file_name(1)).stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 10, hard))
    try:
        with pytest.raises(AuditError, match="File too large"):
            log.append({"event": "given"}).result(60)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (tmp_path / lines.file_name(1)).stat().st_size == size
    log.append({"event": "given"}).result(60)
    close(log)
    assert (look(tmp_path).sound, look(tmp_path).cut, look(tmp_path).trouble) == (4, 0, "")


@pytest.fixture
def hanging(monkeypatch: pytest.MonkeyPatch) -> Iterator[threading.Event]:
    """A disk that answers, where the logs are concerned, once the event is set."""
    answers, fsync = threading.Event(), os.fsync

    def hang(file: int) -> None:
        if Path(f"/proc/self/fd/{file}").readlink().suffix == ".jsonl":
            answers.wait(300)
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
    assert reply.result(60).done
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
        monkeypatch.setattr(service, "_CLOSED_WITHIN_S", 0.1)
        if whole_disk:  # the log of sweeps too
            monkeypatch.setattr(audit_file.os, "fsync", lambda _: hanging.wait(300))
        begun_s = time.monotonic()
        gateway.close()
        assert time.monotonic() - begun_s < 4.0  # one after the other, each log took 2 s
        assert not hanging.is_set()
        hanging.set()
