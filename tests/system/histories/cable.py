"""The lines between units and gateway, each of which can be pulled, hung or spoiled, with a witness at the unit's end.

The witness is what the checker holds the mapper's store against: it reads each sweep as the unit sends it, before any
fault of the line, and each acknowledgement as the unit gets it.
"""

import contextlib
import select
import socket
import threading
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, auto
from time import monotonic

from gateway.bad_line import BadLine, Faults

from noctule_gateway.wire.codec import FrameReader
from noctule_gateway.wire.frames import Ack, Sweep

_TURN_S = 0.02  # how late a change of condition may come
_NOISE = Faults(corrupted=0.003)  # a sweep of three readings is 49 bytes on the line: one in seven is spoiled

Sequences = tuple[int, int]
"""Boot and sequence: a sweep's name, as its unit gives it."""


class Condition(Enum):
    """How a line is."""

    SOUND = auto()
    NOISY = auto()
    HUNG = auto()  # open, and no byte passes
    PULLED = auto()  # a gateway that opens it is cut off


@dataclass
class Witness:
    """What has passed at a unit's end of its line."""

    made: dict[Sequences, Sweep] = field(default_factory=dict)
    handed_over: set[Sequences] = field(default_factory=set)


class Cable:
    """The lines of several units, from making to close(), on a thread of its own."""

    def __init__(self, unit_ports: Sequence[int], gateway_ports: Sequence[int], seed: int) -> None:
        """The units listen on ``unit_ports`` of 127.0.0.1, the gateway finds them on ``gateway_ports``."""
        self._lines = [
            _Line(unit_port, gateway_port, seed + number)
            for number, (unit_port, gateway_port) in enumerate(zip(unit_ports, gateway_ports, strict=True))
        ]
        self._lock = threading.Lock()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name="cable")
        self._thread.start()

    def bring_into(self, conditions: Mapping[int, Condition]) -> None:
        """Lines, by number, that are not sound from now on; all others are."""
        with self._lock:
            for number, line in enumerate(self._lines):
                line.condition = conditions.get(number, Condition.SOUND)

    def witnesses(self) -> list[Witness]:
        """What has passed so far, by line."""
        with self._lock:
            return [Witness(dict(line.witness.made), set(line.witness.handed_over)) for line in self._lines]

    def close(self) -> None:
        """Close every line."""
        self._closing = True
        self._thread.join()

    def _run(self) -> None:
        with contextlib.ExitStack() as closing:
            for line in self._lines:
                closing.callback(line.close)
            while not self._closing:
                sockets = [each for line in self._lines for each in line.sockets()]
                readable, _, _ = select.select(sockets, [], [], _TURN_S)
                with self._lock:
                    for line in self._lines:
                        line.turn(readable)


class _Line:
    """One line: ``_unit`` is the socket to the unit, ``_gateway`` the one that the gateway has opened."""

    def __init__(self, unit_port: int, gateway_port: int, seed: int) -> None:
        self.condition = Condition.SOUND
        self.witness = Witness()
        self._unit_port = unit_port
        self._server = socket.create_server(("127.0.0.1", gateway_port))
        self._unit: socket.socket | None = None
        self._gateway: socket.socket | None = None
        self._up, self._down = FrameReader(), FrameReader()
        self._noise = BadLine(_NOISE, seed)

    def sockets(self) -> list[socket.socket]:
        """All that may have something to read."""
        return [each for each in (self._server, self._unit, self._gateway) if each is not None]

    def turn(self, readable: Collection[socket.socket]) -> None:
        """Pass on what has come, as the line's condition has it."""
        if self._unit is None:
            self._reach_unit()
        if self.condition is Condition.PULLED:
            self._hang_up()
        if self._server in readable:
            self._answer()
        if self._unit is not None and self._unit in readable:
            self._from_unit(self._unit)
        if self._gateway is not None and self._gateway in readable:
            self._from_gateway(self._gateway)

    def close(self) -> None:
        for each in self.sockets():
            each.close()

    def _reach_unit(self) -> None:
        with contextlib.suppress(OSError):
            self._unit = socket.create_connection(("127.0.0.1", self._unit_port))
            self._unit.setblocking(False)
            self._up.reset()
            self._down.reset()

    def _answer(self) -> None:
        opened, _ = self._server.accept()
        if self.condition is Condition.PULLED or self._gateway is not None:
            opened.close()
        else:
            opened.setblocking(False)
            self._gateway = opened

    def _hang_up(self) -> None:
        if self._gateway is not None:
            self._gateway.close()
            self._gateway = None

    def _from_unit(self, unit: socket.socket) -> None:
        data = _read(unit)
        if not data:
            unit.close()
            self._unit = None
        for frame in self._up.feed(data):
            if isinstance(frame, Sweep):
                self.witness.made.setdefault((frame.boot, frame.sequence), frame)
        if self._gateway is not None:
            _write(self._gateway, self._pass(data))

    def _from_gateway(self, gateway: socket.socket) -> None:
        data = _read(gateway)
        if not data:
            self._hang_up()
        passed = self._pass(data)
        for frame in self._down.feed(passed):
            if isinstance(frame, Ack) and (frame.boot, frame.sequence) in self.witness.made:
                self.witness.handed_over.add((frame.boot, frame.sequence))
        if self._unit is not None:
            _write(self._unit, passed)

    def _pass(self, data: bytes) -> bytes:
        if self.condition is Condition.NOISY:
            self._noise.write(data, monotonic())
            return self._noise.read(monotonic())
        return b"" if self.condition is Condition.HUNG else data


def _read(source: socket.socket) -> bytes:
    """What has come; nothing where the far end is gone."""
    try:
        return source.recv(65536)
    except OSError:
        return b""


def _write(target: socket.socket, data: bytes) -> None:
    """Send what is taken at once: a serial line waits for nobody."""
    with contextlib.suppress(OSError):
        target.send(data)
