"""A line behind an RFC 2217 server, by pyserial's client, whatever the server sends.

pyserial's own reader thread dies of a telnet command that it did not expect, and its buffers have no bound. This one
ends the line instead, and reads no faster than the line is emptied, so that TCP makes a flooding server wait.
"""

import logging
import queue
import socket
import threading
import time
from collections.abc import Callable
from functools import partial

import serial
from serial import rfc2217

from noctule_gateway.errors import LineError
from noctule_gateway.line.keepalive import watch_far_end

_log = logging.getLogger(__name__)

_CHUNK_BYTES = 1024
_MOST_WAITING_BYTES = 65536  # more than the line brings during the longest step of the negotiation, 3 s
_NEGOTIATION_STEPS = 2  # the whole negotiation, in the time that one step may take (3 s): there are six
_MOST_SUBOPTION_BYTES = 1024  # RFC 2217 has no longer one than a signature of 255 characters


class Rfc2217Port:
    """As port.Port, open from the start."""

    def __init__(self, address: str, baud: int) -> None:
        """Raises LineError where nobody answers, or not as RFC 2217 says; a silent server takes 3 s, a slow one 6 s."""
        self._address = address
        self._is_woken = False
        self._line = _BoundedSerial(baud)
        self._line.port = address
        try:
            self._line.open()
            self._line.end_negotiation()
            self._line.watch_far_end()
        except (OSError, ValueError, KeyError) as error:  # pyserial's own errors are OSErrors
            raise LineError(f"can't open {address}: {self._line.failure or error}") from error

    def read(self, timeout_s: float) -> bytes:
        try:
            data = self._line.next_piece(timeout_s)
        except serial.SerialException as error:
            raise LineError(f"{self._address} was cut: {error}") from error
        if not data:
            self._is_woken = False
        return data

    def write(self, data: bytes) -> None:
        try:
            self._line.write(data)
        except (serial.SerialException, OSError) as error:
            raise LineError(f"{self._address} takes no more: {error}") from error

    def wake(self) -> None:
        if not self._is_woken:  # once until it is read, so that the buffer has a bound
            self._is_woken = True
            self._line.wake()

    def close(self) -> None:
        self._line.close()


class _BoundedSerial(rfc2217.Serial):
    """``failure`` says what the server sent that ended the line; it is empty where the server hung up."""

    # pyserial's own, which its type stubs leave out.
    _socket: socket.socket
    _read_buffer: "queue.Queue[bytes | None]"
    _telnet_negotiate_option: Callable[[bytes, bytes], None]
    _telnet_process_subnegotiation: Callable[[bytes], None]

    def __init__(self, baud: int) -> None:
        self.failure = ""
        self._emptied = threading.Condition()
        self._bytes_received = self._bytes_read = 0  # each counted by one thread
        self._suboption: bytearray | None = None
        self._step_s = 0.0
        self._give_up_s: float | None = None  # on the negotiation, once it has begun
        self._negotiated = False
        super().__init__(baudrate=baud)

    @property
    def _network_timeout(self) -> float:
        """In place of pyserial's own, which allows as much for each step of the negotiation, however many there are."""
        if self._negotiated:
            return self._step_s
        if self._give_up_s is None:
            self._give_up_s = time.monotonic() + _NEGOTIATION_STEPS * self._step_s
        return max(0.0, min(self._step_s, self._give_up_s - time.monotonic()))

    @_network_timeout.setter
    def _network_timeout(self, step_s: float) -> None:
        self._step_s = step_s

    def end_negotiation(self) -> None:
        """The line is open: what is asked of the server from now on has time of its own."""
        self._negotiated = True

    def watch_far_end(self) -> None:
        """As keepalive.watch_far_end(), of the socket beneath."""
        watch_far_end(self._socket)

    def next_piece(self, timeout_s: float) -> bytes:
        """In place of read(): what came next, empty if nothing does in time or the reader is woken. Raises
        SerialException after the last.
        """
        try:
            piece = self._read_buffer.get(timeout=timeout_s)
        except queue.Empty:
            return b""
        if piece is None:
            self._read_buffer.put(None)  # it stays the last
            raise serial.SerialException(self.failure or "closed at the other end")
        with self._emptied:
            self._bytes_read += len(piece)
            self._emptied.notify()
        return piece

    def wake(self) -> None:
        """Have next_piece() return at once."""
        self._read_buffer.put(b"")

    def close(self) -> None:
        with self._emptied:
            self.is_open = False
            self._emptied.notify()
        super().close()

    def reset_input_buffer(self) -> None:
        """Have the server empty its buffer. To empty this one may never end while the server floods it."""
        self.rfc2217_send_purge(rfc2217.PURGE_RECEIVE_BUFFER)

    def _telnet_read_loop(self) -> None:
        """The reader thread, in place of pyserial's: nothing that it meets may end more than this line."""
        try:
            self._read_telnet()
        except Exception:
            _log.debug("the reader of %s failed", self.portstr, exc_info=True)
            self.failure = "what its server sends is not RFC 2217"
        finally:
            self._read_buffer.put(None)

    def _read_telnet(self) -> None:
        take: _Take = self._take_data
        while self._has_room():
            try:
                received = self._socket.recv(_CHUNK_BYTES)
            except TimeoutError:
                continue
            except OSError:
                return
            if not received:
                return
            while received:
                take, received = take(received)

    def _has_room(self) -> bool:
        """Wait for the line to be emptied far enough; whether it is open then."""
        with self._emptied:
            self._emptied.wait_for(
                lambda: not self.is_open or self._bytes_received - self._bytes_read <= _MOST_WAITING_BYTES
            )
        return self.is_open

    # ---- Telnet. Each takes what it can of the bytes that came; what takes the rest, and the rest. ----

    def _take_data(self, received: bytes) -> "tuple[_Take, bytes]":
        data, command, rest = received.partition(rfc2217.IAC)
        if data:
            self._keep(data)
        return self._take_command if command else self._take_data, rest

    def _take_command(self, received: bytes) -> "tuple[_Take, bytes]":
        byte, rest = received[:1], received[1:]
        if byte in (rfc2217.DO, rfc2217.DONT, rfc2217.WILL, rfc2217.WONT):
            return partial(self._take_option, byte), rest
        if byte == rfc2217.IAC:
            self._keep(byte)
        elif byte == rfc2217.SB:
            self._suboption = bytearray()
        elif byte == rfc2217.SE:
            if self._suboption is None:
                raise ValueError("the end of a subnegotiation that has not begun")
            self._telnet_process_subnegotiation(bytes(self._suboption))
            self._suboption = None
        return self._take_data, rest

    def _take_option(self, command: bytes, received: bytes) -> "tuple[_Take, bytes]":
        self._telnet_negotiate_option(command, received[:1])
        return self._take_data, received[1:]

    def _keep(self, data: bytes) -> None:
        if self._suboption is None:
            self._bytes_received += len(data)
            self._read_buffer.put(data)
        elif len(self._suboption) + len(data) <= _MOST_SUBOPTION_BYTES:
            self._suboption += data
        else:
            raise ValueError("a subnegotiation without an end")


_Take = Callable[[bytes], "tuple[_Take, bytes]"]
