"""A model unit behind a TCP port, as a simulated unit is: it lives on while nobody is connected."""

import contextlib
import selectors
import socket
import threading
import time
from collections.abc import Iterator

from gateway.model_unit import ModelUnit

_LOOK_EVERY_S = 0.005


class TcpUnit:
    """Runs ``unit`` in real time on its own thread; take ``lock`` to look at it or to touch it."""

    def __init__(self, unit: ModelUnit) -> None:
        self.unit = unit
        self.lock = threading.Lock()
        self.connections = 0
        self._muted = False
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._server.getsockname()[1]
        self._connection: socket.socket | None = None
        self._ended = threading.Event()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._server, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    @property
    def address(self) -> str:
        """Where the gateway finds it."""
        return f"socket://127.0.0.1:{self.port}"

    def cut(self) -> None:
        """Cut the line; the gateway may open it again."""
        with self.lock:
            self._hang_up()

    def mute(self) -> None:
        """Lose all that this connection brings, both ways, and leave it open; the next one works."""
        with self.lock:
            self._muted = True

    def close(self) -> None:
        """End it."""
        self._ended.set()
        self._thread.join()
        self._hang_up()
        self._server.close()

    def _run(self) -> None:
        while not self._ended.is_set():
            for key, _ in self._selector.select(_LOOK_EVERY_S):
                with self.lock:
                    self._accept() if key.fileobj is self._server else self._receive()
            with self.lock:
                self._send(self.unit.output(time.monotonic()))

    def _accept(self) -> None:
        self._hang_up()
        self._connection, _ = self._server.accept()
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._selector.register(self._connection, selectors.EVENT_READ)
        self.connections += 1
        self._muted = False

    def _receive(self) -> None:
        if self._connection is None:
            return
        try:
            data = self._connection.recv(4096)
        except OSError:
            data = b""
        if data and self._muted:
            return
        if data:
            self.unit.receive(data, time.monotonic())
            self._send(self.unit.output(time.monotonic()))
        else:
            self._hang_up()

    def _send(self, data: bytes) -> None:
        if self._connection is None or self._muted or not data:
            return
        try:
            self._connection.sendall(data)
        except OSError:
            self._hang_up()

    def _hang_up(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            self._selector.unregister(connection)
            connection.close()


@contextlib.contextmanager
def tcp_unit(unit: ModelUnit) -> Iterator[TcpUnit]:
    """``unit`` on a port, for the length of a test."""
    served = TcpUnit(unit)
    try:
        yield served
    finally:
        served.close()
