"""The line to a unit: a serial device, ``socket://host:port`` or ``rfc2217://host:port``, read as bytes arrive.

pyserial's own read waits for a number of bytes, which would cost a clock exchange its accuracy, so a line that has a
file descriptor is read through it. That also lets wake() end a wait at once; rfc2217 has none and is looked at every
10 ms.
"""

import contextlib
import os
import selectors
import socket
import termios
import time
from typing import Protocol

import serial
from serial import rfc2217

from noctule_gateway.errors import LineError

BAUD = 115200

_CHUNK_BYTES = 4096
_WRITE_TIMEOUT_S = 2.0
_LOOK_EVERY_S = 0.01


class Port(Protocol):
    """An open line. Its methods raise LineError when the line is cut."""

    def read(self, timeout_s: float) -> bytes:
        """What has come, as soon as something has; empty after ``timeout_s`` or a wake()."""
        ...

    def write(self, data: bytes) -> None:
        """Send ``data``."""
        ...

    def wake(self) -> None:
        """End a read() that waits, from any thread."""
        ...

    def close(self) -> None:
        """Close the line."""
        ...


def open_port(address: str) -> Port:
    """Open the line at ``address``. Raises LineError."""
    # pyserial's RFC 2217 knows no time-out for writing and brings one of its own.
    write_timeout_s = None if address.startswith("rfc2217://") else _WRITE_TIMEOUT_S
    try:
        line = serial.serial_for_url(
            address, baudrate=BAUD, timeout=_LOOK_EVERY_S, write_timeout=write_timeout_s, exclusive=True
        )
    except (serial.SerialException, termios.error, OSError, ValueError) as error:  # termios: pulled out meanwhile
        raise LineError(f"can't open {address}: {error}") from error
    if isinstance(line, rfc2217.Serial):
        return _PolledPort(address, line)
    try:
        return _DescriptorPort(address, line, line.fileno())
    except OSError as error:
        line.close()
        raise LineError(f"can't wait for {address}: {error}") from error


class _DescriptorPort:
    def __init__(self, address: str, line: serial.SerialBase, descriptor: int) -> None:
        self._address = address
        self._line = line
        self._descriptor = descriptor
        self._woken, self._waker = socket.socketpair()
        for end in (self._woken, self._waker):
            end.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._selector.register(descriptor, selectors.EVENT_READ)
        if address.startswith("socket://"):
            _send_at_once(descriptor)

    def read(self, timeout_s: float) -> bytes:
        ready = [key.fileobj for key, _ in self._selector.select(timeout_s)]
        if self._woken in ready:
            self._woken.recv(_CHUNK_BYTES)
        if self._descriptor not in ready:
            return b""
        try:
            data = os.read(self._descriptor, _CHUNK_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LineError(f"{self._address} was cut: {error.strerror}") from error
        if not data:
            raise LineError(f"{self._address} was closed at the other end")
        return data

    def write(self, data: bytes) -> None:
        _write(self._line, self._address, data)

    def wake(self) -> None:
        with contextlib.suppress(BlockingIOError, OSError):  # full: it is awake; closed: there is nobody to wake
            self._waker.send(b"\x00")

    def close(self) -> None:
        self._selector.close()
        self._line.close()
        self._woken.close()
        self._waker.close()


class _PolledPort:
    def __init__(self, address: str, line: rfc2217.Serial) -> None:
        self._address = address
        self._line = line
        self._awake = False

    def read(self, timeout_s: float) -> bytes:
        deadline_s = time.monotonic() + timeout_s
        try:
            while not (data := self._line.read(self._line.in_waiting or 1)):
                if self._awake or time.monotonic() >= deadline_s:
                    break
        except (serial.SerialException, OSError) as error:
            raise LineError(f"{self._address} was cut: {error}") from error
        self._awake = False
        return data

    def write(self, data: bytes) -> None:
        _write(self._line, self._address, data)

    def wake(self) -> None:
        self._awake = True

    def close(self) -> None:
        self._line.close()


def _write(line: serial.SerialBase, address: str, data: bytes) -> None:
    try:
        line.write(data)
    except (serial.SerialException, OSError) as error:
        raise LineError(f"{address} takes no more: {error}") from error


def _send_at_once(descriptor: int) -> None:
    """Nagle's algorithm would hold a CLOCK request back until an earlier acknowledgement is confirmed."""
    with socket.socket(fileno=os.dup(descriptor)) as same:
        same.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
