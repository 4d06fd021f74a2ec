"""The thread that holds the line to a unit: it opens it, opens it again when it is cut, and moves bytes."""

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from math import inf
from typing import Protocol

from noctule_gateway.errors import LineError
from noctule_gateway.line.port import Port, open_port

FIRST_RETRY_S = 0.25
LAST_RETRY_S = 5.0
OF_USE_S = 5.0  # a line that is cut sooner is opened ever later, as one that can't be opened
_MAX_WAIT_S = 1.0


class Talker(Protocol):
    """Who speaks on the line. All its methods are called on the line's own thread, with a monotonic time."""

    @property
    def next_s(self) -> float:
        """When advance() is due, if nothing happens before."""
        ...

    def opened(self, now_s: float) -> None:
        """The line is open."""
        ...

    def closed(self, error: LineError, now_s: float) -> None:
        """The line was cut, or can't be opened; it will be tried again."""
        ...

    def receive(self, data: bytes, now_s: float) -> None:
        """Something has come."""
        ...

    def advance(self, now_s: float) -> None:
        """Time has passed; called with the line closed, too. Raises LineError to have an open line opened again."""
        ...

    def output(self, now_s: float) -> bytes:
        """What to write at once."""
        ...


class Line:
    """Runs ``talker`` on the line at ``address`` from start() to stop()."""

    def __init__(self, address: str, talker: Talker, name: str) -> None:
        self._address = address
        self._talker = talker
        self._port: Port | None = None
        self._heard = False
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"line {name}", daemon=True)

    def start(self) -> None:
        """Open the line, and keep it open."""
        self._thread.start()

    def stop(self) -> None:
        """Have the line closed for good, soon."""
        self._closing.set()
        self.call(lambda: None)

    def join(self, within_s: float | None = None) -> bool:
        """Wait for the line to be closed after stop(); whether it was, ``within_s``. One never opened is closed."""
        if self._thread.ident is not None:
            self._thread.join(within_s)
        return not self._thread.is_alive()

    def call(self, function: Callable[[], None]) -> None:
        """Have ``function`` called on the line's thread, soon; from any thread."""
        self._calls.put(function)
        if (port := self._port) is not None:
            port.wake()

    def _run(self) -> None:
        retry_s = FIRST_RETRY_S
        while not self._closing.is_set():
            opened_s = inf
            try:
                self._heard = False
                self._port = open_port(self._address)
                opened_s = time.monotonic()
                self._talker.opened(opened_s)
                self._talk(self._port)
            except LineError as error:
                if time.monotonic() - opened_s >= OF_USE_S:
                    retry_s = FIRST_RETRY_S
                elif self._port is not None and not self._heard and "://" in self._address:
                    error = LineError(f"{error}, before a byte had come: does another program have this line?")
                self._hang_up()
                self._talker.closed(error, time.monotonic())
                self._wait(retry_s)
                retry_s = min(2 * retry_s, LAST_RETRY_S)
        self._hang_up()
        self._make_calls()

    def _talk(self, port: Port) -> None:
        while not self._closing.is_set():
            self._make_calls()
            self._talker.advance(time.monotonic())
            data = self._talker.output(time.monotonic())
            if data:
                port.write(data)
            wait_s = min(self._talker.next_s - time.monotonic(), _MAX_WAIT_S)
            received = port.read(max(wait_s, 0.0))
            if received:
                self._heard = True
                self._talker.receive(received, time.monotonic())

    def _wait(self, duration_s: float) -> None:
        """Let time pass without a line; calls are made meanwhile."""
        end_s = time.monotonic() + duration_s
        while not self._closing.is_set() and (left_s := end_s - time.monotonic()) > 0:
            self._talker.advance(time.monotonic())
            with contextlib.suppress(queue.Empty):
                self._calls.get(timeout=min(left_s, _MAX_WAIT_S))()

    def _make_calls(self) -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                self._calls.get_nowait()()

    def _hang_up(self) -> None:
        port, self._port = self._port, None
        if port is not None:
            port.close()
