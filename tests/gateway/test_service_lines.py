"""The gateway whole, where its lines lead to no unit, to another one, or to one that comes and goes."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import zenoh
from gateway.model_unit import ModelUnit
from gateway.rfc2217_server import server
from gateway.serving import FIXED, SITE, connected, running, site_file, unit_status
from gateway.tcp_unit import tcp_unit
from system.processes import free_ports, programs, wait_until

from noctule import bus
from noctule.client import Client
from noctule.messages_pb2 import UnitStatus
from noctule_gateway.service import Gateway


def test_a_wrong_unit_is_shown_and_nothing_of_it_is_taken(tmp_path: Path, router: zenoh.Session) -> None:
    unit = ModelUnit(8, born_s=time.monotonic())
    unit.make_sweep(time.monotonic())
    with tcp_unit(unit) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: "unit 8 answers" in unit_status(client).detail, "the wrong unit was not shown")
            status = unit_status(client)
        assert status.state == UnitStatus.STATE_DISCONNECTED
        assert status.log_head == 0
        assert len(unit.ring) == 1


@contextmanager
def wrong_device(answer: Callable[[bytes], bytes]) -> Iterator[str]:
    """The address of a device that is no unit: it answers each piece that it gets."""
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def serve() -> None:
            with contextlib.suppress(OSError):  # shut down below
                while True:
                    connection, _ = listening.accept()
                    with connection:
                        while piece := connection.recv(1000):
                            connection.sendall(answer(piece))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield f"socket://127.0.0.1:{listening.getsockname()[1]}"
        finally:
            listening.shutdown(socket.SHUT_RDWR)
            thread.join()


def test_no_answer_and_what_can_not_be_read_and_a_line_that_sends_all_back_are_three_things(
    tmp_path: Path, router: zenoh.Session, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        wrong_device(lambda _: b"") as silent,
        wrong_device(lambda piece: bytes(0x80 | byte for byte in piece)) as garbled,
        wrong_device(lambda piece: piece) as looped,
    ):
        told = {
            "u1": f"no answer on {silent}",
            "u2": f"what comes on {garbled} can't be read: another device, or another baud rate?",
            "u3": f"no answer on {looped}, though frames come: check the wire to the unit, and whether the line sends "
            "back what it is sent",
        }
        units = [
            (name, 7 + n, each, FIXED)
            for n, (name, each) in enumerate(zip(told, (silent, garbled, looped), strict=True))
        ]
        with running(site_file(tmp_path, *units), tmp_path, router), Client(SITE, session=router) as client:
            for name, detail in told.items():
                wait_until(lambda: unit_status(client, name).detail == detail, f"{name} is not told")  # noqa: B023
    for name, detail in told.items():
        assert f"{name}: {detail}" in caplog.text


def test_a_connection_that_has_gone_mute_is_opened_again_though_it_was_never_closed(
    tmp_path: Path, router: zenoh.Session
) -> None:
    """As behind a terminal server that holds on to a connection of before its restart of the serial side."""
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            line.mute()
            wait_until(lambda: not connected(client), "its silence was not seen")
            wait_until(lambda: connected(client), "the mute connection was kept")
            assert line.connections >= 2


def test_a_unit_that_is_not_there_is_shown_and_served_as_soon_as_it_is(tmp_path: Path, router: zenoh.Session) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        (closed_port,) = free_ports(1)
        path = site_file(
            tmp_path,
            ("u1", 7, line.address, FIXED),
            ("u2", 8, f"socket://127.0.0.1:{closed_port}", FIXED),
        )
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            line.cut()
            wait_until(lambda: line.connections >= 2, "the line was not opened again")
            wait_until(lambda: connected(client), "the unit was not connected again")
            assert unit_status(client, "u2").state == UnitStatus.STATE_DISCONNECTED
            assert "can't open" in unit_status(client, "u2").detail


def test_a_status_says_since_when_a_unit_has_answered_and_since_when_it_has_not(
    tmp_path: Path, router: zenoh.Session
) -> None:
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        begun_s = time.time()
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            connected_s = time.time()
            up_s = unit_status(client).since.ToMilliseconds() / 1000
            assert begun_s - 0.001 <= up_s <= connected_s
            line.close()
            wait_until(lambda: not connected(client), "the unit is still shown")
            down_s = unit_status(client).since.ToMilliseconds() / 1000
            assert connected_s - 0.001 <= down_s <= time.time()
            reported = unit_status(client).time
            wait_until(lambda: unit_status(client).time != reported, "no further status")
            assert unit_status(client).since.ToMilliseconds() / 1000 == pytest.approx(down_s, abs=0.5)


def test_a_server_that_sends_no_rfc2217_is_its_units_trouble_and_the_other_units_are_served(tmp_path: Path) -> None:
    def send(connection: socket.socket) -> None:
        connection.sendall(bytes.fromhex("ff fa 2c 65 ff f0"))
        while connection.recv(1000):
            pass

    (port,) = free_ports(1)
    unit = ModelUnit(7, born_s=time.monotonic())
    with tcp_unit(unit) as line, server(send, timeout_s=0.3) as address, programs(tmp_path) as started:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED), ("u2", 8, address, FIXED))
        endpoint = f"tcp/127.0.0.1:{port}"
        started.start("gateway", "noctule-gateway", "run", str(path), "--data", str(tmp_path), "--listen", endpoint)
        with Client(SITE, connect=[endpoint]) as client:
            wait_until(lambda: connected(client), "the sound unit was not connected")
            wait_until(lambda: "not RFC 2217" in unit_status(client, "u2").detail, "the trouble is not told")
            with line.lock:
                unit.make_sweep(time.monotonic())
            wait_until(lambda: not unit.ring, "the sound unit is not served")
        assert started.end("gateway") == 0


def test_two_gateways_on_one_unit_both_say_so_until_one_is_gone(tmp_path: Path) -> None:
    told = f"another gateway serves it too (gateway on {socket.gethostname()}): take it out of one site file"
    path = site_file(tmp_path, ("u1", 7, "socket://127.0.0.1:9", FIXED))
    (port,) = free_ports(1)
    with (
        bus.open_session(listen=[f"tcp/127.0.0.1:{port}"]) as router,
        running(path, tmp_path / "first", router) as first,
        bus.open_session(connect=[f"tcp/127.0.0.1:{port}"]) as joined,
    ):

        def details(gateway: Gateway) -> str:
            return next(status.detail for status in gateway.statuses() if isinstance(status, UnitStatus))

        with running(path, tmp_path / "second", joined) as second:
            for gateway in (first, second):
                wait_until(lambda: details(gateway).startswith(told), "no alarm")  # noqa: B023
        wait_until(lambda: told not in details(first), "the alarm stays")
