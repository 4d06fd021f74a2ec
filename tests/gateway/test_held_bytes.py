"""What a client, or all of them, can have a gateway hold by queries that wait has a limit in bytes."""

import threading
from concurrent.futures import Future
from pathlib import Path

import pytest
import zenoh
from gateway.serving import FIXED, SITE, running, site_file
from system.processes import PATIENCE_S, wait_until

from noctule import keys
from noctule.messages_pb2 import CommandReply, CommandRequest
from noctule_gateway.bus import held_bytes
from noctule_gateway.bus.held_bytes import MOST_OF_ALL, MOST_OF_ONE, HeldBytes
from noctule_gateway.unit.unit_server import UnitServer

PART = MOST_OF_ONE // 4


def test_each_client_has_its_limit_and_all_have_one_and_a_first_query_has_room_whatever_its_size() -> None:
    held = HeldBytes()
    assert [bool(held.hold("c", PART)) for _ in range(4)] == [False, False, False, True]  # with what a query takes too
    assert "other queries of c have" in held.hold("c", PART)
    held.let_go("c", PART)
    assert not held.hold("c", PART)
    others = [bool(held.hold(f"o{number}", MOST_OF_ONE)) for number in range(MOST_OF_ALL // MOST_OF_ONE)]
    assert others == [False] * (len(others) - 1) + [True]
    assert not HeldBytes().hold("c", 2 * MOST_OF_ALL)


def test_one_request_that_comes_again_and_again_while_it_is_under_way_fills_no_memory(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of them waits for the same reply; their number had no limit, and each may have a megabyte."""
    monkeypatch.setattr(held_bytes, "MOST_OF_ONE", 10_000)
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
        wait_until(lambda: len(errors) >= 1, "none is refused")
        reply.set_result(CommandReply(request_id="r", done=True))
        assert all(ended.acquire(timeout=PATIENCE_S) for _ in range(10))
    assert given == ["update"]
    assert len(answered) == 2
    assert "of 10000 bytes that may wait: ask again when they are answered" in errors[0]
