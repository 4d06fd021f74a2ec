"""A line behind an RFC 2217 server that sends what it should not: an error of that line, and of nothing else."""

import random
import socket
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import pytest
from gateway.rfc2217_server import negotiate, server
from system.processes import PATIENCE_S, wait_until

from noctule_gateway.errors import LineError
from noctule_gateway.line.port import Port, open_port

UNASKED_ANSWER = bytes.fromhex("ff fa 2c 65 ff f0")  # SET-BAUDRATE is answered without a value, and was not asked
PIECES = [
    *(bytes([255, command]) for command in range(236, 256)),  # IAC and every telnet command: RFC 854
    *(bytes([255, 250, 44, option]) for option in (*range(14), *range(100, 114))),  # IAC SB COM-PORT: RFC 2217
    *(bytes([255, verb, option]) for verb in range(251, 255) for option in (0, 1, 3, 24, 44, 255)),
    *(bytes([value]) for value in (0, 1, 8, 44, 101, 255)),
    b"\xff\xf0",
    b"data" * 300,
]


@pytest.fixture
def failed_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[threading.ExceptHookArgs]]:
    """What the gateway would end of (cli/run.py)."""
    failed: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", failed.append)
    yield failed
    assert failed == []


def read_to_the_end(port: Port) -> int:
    """Read until the line is cut; how many bytes came."""
    count = 0
    deadline_s = time.monotonic() + PATIENCE_S
    try:
        while time.monotonic() < deadline_s:
            count += len(port.read(1.0))
    except LineError:
        return count
    finally:
        port.close()
    raise AssertionError("the line was not cut")


@pytest.mark.usefixtures("failed_threads")
@pytest.mark.parametrize(
    ("sent", "open_before"),
    [
        (UNASKED_ANSWER, False),  # once the line is open it was asked for
        (b"\xff\xf0", False),
        (b"\xff\xf0", True),
        (b"\xff\xfa" + bytes(10_000), False),
        (b"\xff\xfa" + bytes(10_000), True),
    ],
)
def test_what_is_no_rfc2217_is_named_as_the_lines_error(sent: bytes, open_before: bool) -> None:
    ended = threading.Event()

    def send(connection: socket.socket) -> None:
        if open_before:
            negotiate(connection)
        connection.sendall(sent)
        ended.wait(PATIENCE_S)

    with server(send, timeout_s=20.0 if open_before else 2.0) as address:
        try:
            with pytest.raises(LineError, match=r"what its server sends is not RFC 2217$"):
                port = open_port(address)
                while True:
                    port.read(1.0)
        finally:
            ended.set()


def test_random_telnet_bytes_end_a_line_and_no_thread(failed_threads: list[threading.ExceptHookArgs]) -> None:
    def suffer(seed: int) -> str:
        dice = random.Random(seed)
        garbage = b"".join(dice.choices(PIECES, k=dice.randrange(1, 60)))
        open_before = seed % 2 == 1

        def send(connection: socket.socket) -> None:
            if open_before:
                negotiate(connection)
            connection.sendall(garbage)

        with server(send, timeout_s=20.0 if open_before else 0.2) as address:
            try:
                port = open_port(address)
            except LineError:
                return "not opened"
            read_to_the_end(port)
            return "opened"

    before = threading.active_count()
    with ThreadPoolExecutor(16) as pool:
        results = list(pool.map(suffer, range(200)))
    assert failed_threads == []
    assert {"opened", "not opened"} == set(results)
    wait_until(lambda: threading.active_count() <= before, "threads are left")


@pytest.mark.usefixtures("failed_threads")
def test_a_server_that_never_answers_is_given_up_in_seconds() -> None:
    ended = threading.Event()

    def say_nothing(_: socket.socket) -> None:
        ended.wait(PATIENCE_S)

    with server(say_nothing) as address:
        begun_s = time.monotonic()
        with pytest.raises(LineError, match="does not seem to support RFC2217"):
            open_port(address)
        assert time.monotonic() - begun_s < 10.0
        ended.set()


@pytest.mark.usefixtures("failed_threads")
def test_a_server_that_answers_each_step_late_is_given_up_as_one_that_says_nothing() -> None:
    step_s = 0.5

    def dawdle(connection: socket.socket) -> None:
        negotiate(connection, each_answer_after_s=0.4 * step_s)

    with server(dawdle, timeout_s=step_s) as address:
        begun_s = time.monotonic()
        with pytest.raises(LineError, match="can't open rfc2217://"):
            open_port(address)
        # It takes two steps, and 0.3 s for the server to notice that it is over. By pyserial it may take all six steps.
        assert time.monotonic() - begun_s < 6 * step_s


@pytest.mark.usefixtures("failed_threads")
def test_a_server_that_floods_is_made_to_wait_and_all_that_it_sent_is_read() -> None:
    sent_bytes: list[int] = []
    at_rest = threading.Event()
    chunk = bytes(2**16)

    def flood(connection: socket.socket) -> None:
        negotiate(connection)
        connection.settimeout(1.0)
        count = 0
        try:
            while count < 2**28:
                count += connection.send(chunk)
        except TimeoutError:
            pass
        sent_bytes.append(count)
        at_rest.set()

    with server(flood) as address:
        port = open_port(address)
        assert at_rest.wait(PATIENCE_S)
        (count,) = sent_bytes
        # Linux keeps at most 4 MB to send and 6 MB received for a connection (tcp(7): tcp_wmem, tcp_rmem).
        assert count < 11 * 2**20
        assert read_to_the_end(port) == count


@pytest.mark.usefixtures("failed_threads")
def test_a_flood_before_the_line_is_open_does_not_keep_the_opening_from_its_end() -> None:
    def flood(connection: socket.socket) -> None:
        connection.settimeout(1.0)
        while True:
            connection.send(bytes(2**16))

    with server(flood, timeout_s=0.5) as address, pytest.raises(LineError):
        open_port(address)
