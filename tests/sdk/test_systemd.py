"""What systemd receives of a service, on a real socket; the protocol is sd_notify(3)."""

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from noctule.systemd import ServiceManager


@pytest.fixture(params=["a path", "an abstract address"])
def systemd(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        if request.param == "a path":
            receiver.bind(str(tmp_path / "notify"))
            monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        else:
            receiver.bind("")  # the kernel chooses one, which begins with a zero byte
            monkeypatch.setenv("NOTIFY_SOCKET", "@" + receiver.getsockname()[1:].decode())
        receiver.settimeout(10)
        yield receiver


def received(systemd: socket.socket) -> set[str]:
    return set(systemd.recv(4096).decode().splitlines())


def test_a_service_is_ready_once_pings_while_it_makes_progress_and_stops(systemd: socket.socket) -> None:
    manager = ServiceManager()
    manager.serving("2 of 3 units\nconnected")
    manager.serving("all is well")
    manager.serving("hangs", progress=False)
    manager.stopping()
    assert received(systemd) == {"READY=1", "WATCHDOG=1", "STATUS=2 of 3 units connected"}
    assert received(systemd) == {"WATCHDOG=1", "STATUS=all is well"}
    assert received(systemd) == {"STATUS=hangs"}
    assert received(systemd) == {"STOPPING=1", "STATUS=stopping"}


def test_a_service_that_waits_for_a_router_is_not_ready_and_asks_for_more_time(systemd: socket.socket) -> None:
    ServiceManager().waiting("no router")
    assert received(systemd) == {"EXTEND_TIMEOUT_USEC=30000000", "STATUS=no router"}


def test_a_systemd_that_reads_nothing_holds_up_nobody(systemd: socket.socket) -> None:
    manager = ServiceManager()
    for _ in range(10_000):  # the kernel holds net.unix.max_dgram_qlen messages, a few hundred
        manager.serving("well")
    assert "READY=1" in received(systemd)


def test_without_systemd_nothing_is_sent_and_a_socket_that_is_gone_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    ServiceManager().serving("well")
    assert not caplog.records
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "gone"))
    manager = ServiceManager()
    manager.serving("well")
    manager.serving("well")
    assert [record.getMessage().split(" (")[0] for record in caplog.records] == [
        f"systemd can't be notified at {tmp_path / 'gone'}"
    ]
