"""What a client, or all of them, can have a gateway hold by queries that wait has a limit in bytes."""

import threading
from concurrent.futures import Future
from pathlib import Path

import pytest
import zenoh
from gateway.serving import FIXED, SITE, running, site_file
from system.processes import PATIENCE_S

from noctule import keys
from noctule.messages_pb2 import Caller, CommandReply, CommandRequest
from noctule_gateway import service
from noctule_gateway.bus import log_readers, unit_on_bus
from noctule_gateway.bus.held_bytes import MOST_OF_ALL_BYTES, MOST_OF_ONE_BYTES, HeldBytes
from noctule_gateway.unit.unit_server import UnitServer

PART = MOST_OF_ONE_BYTES // 4


def give_each_client_less(monkeypatch: pytest.MonkeyPatch) -> None:
    """10,000 bytes each for queries of logs and for commands."""
    for module in (service, log_readers):
        monkeypatch.setattr(module, "HeldBytes", lambda: HeldBytes(10_000))


def test_each_client_has_its_limit_and_all_have_one_and_a_first_query_has_room_whatever_its_size() -> None:
    held = HeldBytes()
    assert [bool(held.hold("c", PART)) for _ in range(4)] == [False, False, False, True]  # with what a query takes too
    assert "other queries of c have" in held.hold("c", PART)
    held.let_go("c", PART)
    assert not held.hold("c", PART)
    others = [
        bool(held.hold(f"o{number}", MOST_OF_ONE_BYTES)) for number in range(MOST_OF_ALL_BYTES // MOST_OF_ONE_BYTES)
    ]
    assert others == [False] * (len(others) - 1) + [True]
    assert not HeldBytes().hold("c", 2 * MOST_OF_ALL_BYTES)


def test_one_request_that_comes_again_and_again_while_it_is_under_way_fills_no_memory(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of them waits for the same reply; their number had no limit, and each may have a megabyte."""
    give_each_client_less(monkeypatch)
    reply, given = Future[CommandReply](), list[str]()
    monkeypatch.setattr(UnitServer, "command", lambda _server, name, *_: given.append(name) or reply)
    request = CommandRequest(request_id="r", image=bytes(3000)).SerializeToString()
    ended, errors, answered = threading.Semaphore(0), list[str](), list[zenoh.Sample]()

    def came(each: zenoh.Reply) -> None:
        if each.ok is not None:
            answered.append(each.ok)
        elif each.err is not None:
            errors.append(each.err.payload.to_string())

    with running(site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED)), tmp_path / "data", router):
        handler = zenoh.handlers.Callback(came, ended.release)
        for _ in range(10):
            router.get(keys.rpc(SITE, "u1", "update"), handler, payload=request, timeout=PATIENCE_S)
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(8)), "not all others are refused"
        reply.set_result(CommandReply(request_id="r", done=True))
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(2))
    assert given == ["update"]
    assert len(answered) == 2
    assert "of 10000 bytes that may wait: ask again when they are answered" in errors[0]


def test_logs_and_commands_that_fill_the_room_under_an_operators_name_leave_its_stop_room(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A log's client is what it says: one that called itself by an operator's name had the operator's stop refused."""
    give_each_client_less(monkeypatch)
    filling = bytes(4400)  # two leave no room for a stop, which takes more than 512 bytes
    thaw, begun, ended = threading.Event(), list[tuple[str, Future[CommandReply]]](), threading.Semaphore(0)

    def read(*_asked: object) -> bytes:
        thaw.wait(PATIENCE_S)
        return b""

    def command(_server: UnitServer, name: str, request: CommandRequest) -> Future[CommandReply]:
        begun.append((name, Future()))
        if name == "stop":
            begun[-1][1].set_result(CommandReply(request_id=request.request_id, done=True))
        return begun[-1][1]

    monkeypatch.setattr(unit_on_bus, "read_records", read)
    monkeypatch.setattr(UnitServer, "command", command)
    handler = zenoh.handlers.Callback(lambda _reply: None, ended.release)
    log, home, stop = keys.log(SITE, "u1"), keys.rpc(SITE, "u1", "home"), keys.rpc(SITE, "u1", "stop")
    anna = Caller(session="anna").SerializeToString()

    with running(site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED)), tmp_path / "data", router):
        for _ in range(10):
            router.get(log, handler, payload=filling, attachment=b"session anna", timeout=PATIENCE_S)
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(8)), "not all other queries of the log are refused"
        for number in range(10):
            request = CommandRequest(request_id=f"r{number}", image=filling).SerializeToString()
            router.get(home, handler, payload=request, attachment=anna, timeout=PATIENCE_S)
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(8)), "not all other commands are refused"
        request = CommandRequest(request_id="s").SerializeToString()
        (reply,) = router.get(stop, payload=request, attachment=anna, timeout=PATIENCE_S)
        thaw.set()
        for _, under_way in begun[:2]:
            under_way.set_result(CommandReply(done=True))
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(4))
    assert [name for name, _ in begun] == ["home", "home", "stop"]
    assert reply.ok is not None
    assert CommandReply.FromString(reply.ok.payload.to_bytes()).done
