"""Lines of every kind: a device (a pseudo-terminal), a socket, and RFC 2217 served by pyserial's own server side."""

import contextlib
import os
import pty
import resource
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest
import serial
from serial.rfc2217 import PortManager
from system.processes import wait_until

from noctule_gateway.errors import LineError
from noctule_gateway.line.port import Port, open_port

LONG_S = 20.0
ALL_BYTES = bytes(range(256))


@contextlib.contextmanager
def line(address: str) -> Iterator[Port]:
    port = open_port(address)
    try:
        yield port
    finally:
        port.close()


def address_of(scheme: str, server: socket.socket) -> str:
    return f"{scheme}://127.0.0.1:{server.getsockname()[1]}"


def read(port: Port, count: int) -> bytes:
    data = b""
    while len(data) < count:
        data += port.read(LONG_S)
    return data


def read_far(file: int, count: int) -> bytes:
    """So much of what was written at the near end, in whatever pieces it comes."""
    data = b""
    while len(data) < count:
        data += os.read(file, count - len(data))
    return data


def test_a_device_carries_every_byte_both_ways_and_says_when_it_is_pulled_out() -> None:
    far, near = pty.openpty()
    tty.setraw(near)
    with line(os.ttyname(near)) as port:
        os.close(near)
        port.write(ALL_BYTES)
        assert read_far(far, 256) == ALL_BYTES
        os.write(far, ALL_BYTES)
        assert read(port, 256) == ALL_BYTES
        os.close(far)
        with pytest.raises(LineError, match="/dev/pts/"):
            port.read(LONG_S)


@pytest.fixture
def a_thousand_files() -> Iterator[None]:
    """Takes all descriptors up to 1024, where select() ends."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(limits[0], 1100), limits[1]))
    taken = [os.open(os.devnull, os.O_RDONLY)]
    while taken[-1] < 1024:
        taken.append(os.dup(taken[0]))
    yield
    for each in taken:
        os.close(each)
    resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.mark.usefixtures("a_thousand_files")
def test_the_lines_of_a_site_of_hundreds_of_units_work_like_the_first_ones() -> None:
    far, near = pty.openpty()
    tty.setraw(near)
    with line(os.ttyname(near)) as port:
        port.write(ALL_BYTES)
        assert read_far(far, 256) == ALL_BYTES
        os.write(far, ALL_BYTES)
        assert read(port, 256) == ALL_BYTES
    os.close(far)
    os.close(near)
    with socket.create_server(("127.0.0.1", 0)) as server, line(address_of("socket", server)) as port:
        connection, _ = server.accept()
        with connection:
            port.write(ALL_BYTES)
            assert connection.recv(256, socket.MSG_WAITALL) == ALL_BYTES
            connection.sendall(ALL_BYTES)
            assert read(port, 256) == ALL_BYTES


def test_a_device_that_a_program_holds_is_not_opened_and_the_program_is_named() -> None:
    far, near = pty.openpty()
    device = os.ttyname(near)
    hold = f"import serial; held = serial.Serial({device!r}, exclusive=True); print(flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None and other.stdout.readline()
        os.close(near)  # this process has it open else
        name = Path(f"/proc/{other.pid}/comm").read_text().strip()
        with pytest.raises(LineError) as refused:
            open_port(device)
        assert str(refused.value) == f"can't open {device}: in use by {name} (process {other.pid}): stop that program"
        other.communicate("\n")
    os.close(far)


def test_a_socket_carries_every_byte_both_ways_and_says_when_it_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, line(address_of("socket", server)) as port:
        far, _ = server.accept()
        port.write(ALL_BYTES)
        assert far.recv(256, socket.MSG_WAITALL) == ALL_BYTES
        far.sendall(ALL_BYTES)
        assert read(port, 256) == ALL_BYTES
        far.close()
        with pytest.raises(LineError, match="closed at the other end"):
            port.read(LONG_S)


def test_a_reader_that_waits_is_woken_from_another_thread() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, line(address_of("socket", server)) as port:
        begun_s = time.monotonic()
        waker = threading.Timer(0.05, port.wake)
        waker.start()
        assert port.read(LONG_S) == b""
        waker.join()
        assert time.monotonic() - begun_s < LONG_S / 2


def test_rfc2217_carries_every_byte_both_ways_and_wakes_and_says_when_it_is_closed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        echo = threading.Thread(target=serve_echo, args=(server,))
        echo.start()
        with line(address_of("rfc2217", server)) as port:
            port.write(ALL_BYTES)
            assert read(port, 256) == ALL_BYTES
            port.wake()
            assert port.read(LONG_S) == b""
            port.write(b"END")
            echo.join()
            with pytest.raises(LineError, match="was cut"):
                wait_until(lambda: port.read(LONG_S) == b"?", "the end was not seen", LONG_S)


def serve_echo(server: socket.socket) -> None:
    """An RFC 2217 server with a looped-back port; it hangs up at END."""
    connection, _ = server.accept()
    looped = serial.serial_for_url("loop://", timeout=0)

    class Wire:
        def write(self, data: bytes) -> None:
            connection.sendall(data)

    manager = PortManager(looped, Wire())  # pyright: ignore[reportArgumentType]: the stubs know one kind of port
    with connection:
        while data := connection.recv(1000):
            content = b"".join(manager.filter(data))
            if content == b"END":
                return
            connection.sendall(b"".join(manager.escape(content)))


def test_an_address_that_can_not_be_opened_is_named() -> None:
    with pytest.raises(LineError, match="can't open /dev/no-such-device: it is not there: plug the adapter in"):
        open_port("/dev/no-such-device")
    with socket.create_server(("127.0.0.1", 0)) as closed:
        address = address_of("socket", closed)
    with pytest.raises(LineError, match=f"can't open {address}: nothing listens there: start it"):
        open_port(address)
    with pytest.raises(LineError, match="can't open quux"):
        open_port("quux://unit")


@pytest.mark.parametrize("scheme", ["socket", "rfc2217"])
def test_a_line_over_tcp_whose_far_end_vanishes_without_a_word_is_cut_within_20_s(scheme: str) -> None:
    """By the kernel: 5 s idle and 3 probes 5 s apart (tcp(7)); the same 20 s where something is unacknowledged."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        far = threading.Thread(target=serve_echo, args=(server,))
        far.start()
        with line(address_of(scheme, server)) as port:
            near = connected_to(server)
            assert near.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            options = (socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT, socket.TCP_USER_TIMEOUT)
            assert [near.getsockopt(socket.IPPROTO_TCP, option) for option in options] == [5, 5, 3, 20_000]
            near.close()
            port.write(b"END")
            far.join()


def connected_to(server: socket.socket) -> socket.socket:
    """Another handle on this process's own socket that is connected to ``server``."""
    for connection in psutil.Process().net_connections("tcp"):
        if connection.raddr == server.getsockname():
            return socket.socket(fileno=os.dup(connection.fd))
    raise AssertionError("nothing is connected to the server")
