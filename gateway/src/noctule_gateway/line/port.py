"""The line to a unit: a serial device, ``socket://host:port`` or ``rfc2217://host:port``, read as bytes arrive.

pyserial's own read waits for a number of bytes, which would cost a clock exchange its accuracy, so a line that has a
file descriptor is read and written through it. That also lets wake() end a wait at once. rfc2217 has none:
rfc2217_port.py.
"""

import contextlib
import errno
import os
import selectors
import socket
import termios
import time
from pathlib import Path
from typing import Protocol
from urllib.parse import urlsplit

import serial

from noctule.doctor.host import Host
from noctule_gateway.errors import LineError
from noctule_gateway.line.keepalive import watch_far_end
from noctule_gateway.line.rfc2217_port import Rfc2217Port

BAUD = 115200

_CHUNK_BYTES = 4096
_CONNECT_TIMEOUT_S = 5.0
_WRITE_TIMEOUT_S = 2.0


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
    try:
        if address.startswith("socket://"):
            return _DescriptorPort(address, _connect(*_host_and_port(address)))
        if address.startswith("rfc2217://"):
            _host_and_port(address)
            return Rfc2217Port(address, BAUD)
        return _DescriptorPort(address, serial.Serial(address, baudrate=BAUD, exclusive=True))
    except (serial.SerialException, termios.error, OSError, ValueError) as error:  # termios: pulled out meanwhile
        raise LineError(f"can't open {address}: {_why(address, error)}") from error


def _why(address: str, error: Exception) -> str:
    """What is wrong, and what to do."""
    match getattr(error, "errno", None):
        case errno.EWOULDBLOCK | errno.EBUSY:
            return _in_use(Path(address))
        case errno.ENOENT:
            return "it is not there: plug the adapter in, or correct the address (ls /dev/serial/by-id)"
        case errno.EACCES:
            return "permission denied: sudo adduser $USER dialout, and log in again"
        case errno.ECONNREFUSED:
            return "nothing listens there: start it, or correct the address"
        case _:
            return str(error)


def _in_use(device: Path) -> str:
    holders = ", ".join(f"{name} (process {pid})" for pid, name in Host().holders(device))
    return (
        f"in use by {holders}: stop that program" if holders else "in use: sudo noctule doctor SITE.toml says by whom"
    )


def _host_and_port(address: str) -> tuple[str, int]:
    where = urlsplit(address)
    if where.hostname is None or where.port is None:
        raise ValueError(f"write it as {where.scheme}://host:port")
    return where.hostname, where.port


def _connect(host: str, port: int) -> socket.socket:
    line = socket.create_connection((host, port), timeout=_CONNECT_TIMEOUT_S)
    # Nagle's algorithm would hold a CLOCK request back until an earlier acknowledgement is confirmed.
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    watch_far_end(line)
    return line


class _Descriptor(Protocol):
    """Who owns a file descriptor."""

    def fileno(self) -> int: ...

    def close(self) -> None: ...


class _DescriptorPort:
    """Waits by a selector of its own: pyserial's select() can't do with descriptors from 1024 on, as of a big site."""

    def __init__(self, address: str, line: _Descriptor) -> None:
        self._address = address
        self._line = line
        self._descriptor = line.fileno()
        os.set_blocking(self._descriptor, False)
        self._woken, self._waker = socket.socketpair()
        for end in (self._woken, self._waker):
            end.setblocking(False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._woken, selectors.EVENT_READ)
        self._selector.register(self._descriptor, selectors.EVENT_READ)

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
        give_up_s = time.monotonic() + _WRITE_TIMEOUT_S
        try:
            while data:
                data = data[self._write_some(data, give_up_s) :]
        except OSError as error:
            raise LineError(f"{self._address} takes no more: {error.strerror}") from error

    def wake(self) -> None:
        with contextlib.suppress(BlockingIOError, OSError):  # full: it is awake; closed: there is nobody to wake
            self._waker.send(b"\x00")

    def close(self) -> None:
        self._selector.close()
        self._line.close()
        self._woken.close()
        self._waker.close()

    def _write_some(self, data: bytes, give_up_s: float) -> int:
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            with selectors.DefaultSelector() as room:
                room.register(self._descriptor, selectors.EVENT_WRITE)
                if not room.select(max(give_up_s - time.monotonic(), 0.0)):
                    raise TimeoutError(errno.ETIMEDOUT, f"nothing in {_WRITE_TIMEOUT_S:g} s") from None
            return 0
