"""RFC 2217 servers for tests: pyserial's own server side, which may send anything after the negotiation, or instead."""

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator

import serial
from serial.rfc2217 import PortManager

Behave = Callable[[socket.socket], None]


@contextlib.contextmanager
def server(behave: Behave, timeout_s: float = 3.0) -> Iterator[str]:
    """The address of a server that does ``behave`` with each connection and then hangs up.

    ``timeout_s`` is how long the client waits for each step of the negotiation.
    """
    with socket.create_server(("127.0.0.1", 0)) as listening:
        thread = threading.Thread(target=_serve, args=(listening, behave))
        thread.start()
        try:
            yield f"rfc2217://127.0.0.1:{listening.getsockname()[1]}?timeout={timeout_s}"
        finally:
            listening.shutdown(socket.SHUT_RDWR)  # ends accept()
            thread.join()


def _serve(listening: socket.socket, behave: Behave) -> None:
    while True:
        try:
            connection, _ = listening.accept()
        except OSError:
            return
        with connection, contextlib.suppress(OSError):
            connection.settimeout(20.0)
            behave(connection)


def negotiate(connection: socket.socket, each_answer_after_s: float = 0.0) -> None:
    """Answer the client as RFC 2217 says until its line is open: the purge of the output buffer is its last request."""
    looped = serial.serial_for_url("loop://", timeout=0)
    asked = bytearray()

    class Wire:
        def write(self, data: bytes) -> None:
            connection.sendall(data)

    manager = PortManager(looped, Wire())  # pyright: ignore[reportArgumentType]: the stubs know one kind of port
    while bytes.fromhex("ff fa 2c 0c 02 ff f0") not in asked:
        received = connection.recv(1000)
        if not received:
            raise ConnectionResetError("the client has left")
        asked += received
        threading.Event().wait(each_answer_after_s)
        for _ in manager.filter(received):
            pass
