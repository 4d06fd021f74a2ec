"""A gateway's link and a unit's real firmware on one bad cable, in lockstep on simulated time."""

from dataclasses import dataclass, field
from random import Random

from firmware.stepped_unit import SteppedUnit
from gateway.bad_line import BadLine, Faults

from noctule_gateway.codec import FrameReader
from noctule_gateway.events import Event, OrderSettled, StatusRead, SweepRead
from noctule_gateway.frames import Order, Status, Sweep
from noctule_gateway.link import Link

CLEAN = Faults()
_INSTANT_S = 1e-6  # what the simulator's ticks may leave of a time


@dataclass
class Tally:
    """What has passed: ``made`` at the unit's end of the cable, before any fault, ``arrived`` out of the link."""

    made: dict[tuple[int, int], Sweep] = field(default_factory=dict)
    arrived: list[Sweep] = field(default_factory=list)
    status: Status | None = None
    settled: list[OrderSettled] = field(default_factory=list)


class Lockstep:
    """``link`` serves ``unit``; what the link hands over is committed at once."""

    def __init__(self, unit: SteppedUnit, link: Link, faults: Faults, seed: int) -> None:
        self.tally = Tally()
        self._unit, self._link = unit, link
        self._witness = FrameReader()
        self._random = Random(seed)
        self._plugged = True
        self.spoil(faults)
        self._take(link.connected(unit.now_s))

    def spoil(self, faults: Faults) -> None:
        """The cable has these faults from now on."""
        self._down, self._up = (BadLine(faults, self._random.getrandbits(32)) for _ in range(2))

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self._unit.now_s + duration_s
        while self._unit.now_s < end_s - _INSTANT_S:
            self._exchange(end_s)

    def pull(self, duration_s: float) -> None:
        """Pull the cable out for so long, then plug it in again."""
        self._plugged = False
        self._take(self._link.connected(self._unit.now_s))
        self.run(duration_s)
        self._plugged = True
        self._take(self._link.connected(self._unit.now_s))

    def carry_out(self, order: Order, within_s: float) -> None:
        """Have the unit carry ``order`` out."""
        ticket = self._link.order(order)
        end_s = self._unit.now_s + within_s
        while not any(settled.ticket == ticket for settled in self.tally.settled):
            assert self._unit.now_s < end_s, f"{order} was not settled within {within_s} s"
            self._exchange(end_s)
        assert self.tally.settled[-1].error is None

    def drained(self, within_s: float) -> Status:
        """The first status from now on that says that no sweep waits."""
        self.tally.status = None
        end_s = self._unit.now_s + within_s
        while (status := self.tally.status) is None or status.sweeps_waiting:
            assert self._unit.now_s < end_s, f"sweeps still wait after {within_s} s: {status}"
            self._exchange(end_s)
        return status

    def _exchange(self, end_s: float) -> None:
        """What the link has to say goes down; then time passes until the unit has sent a frame or the link is due."""
        now_s = self._unit.now_s
        self._take(self._link.advance(now_s))
        said = self._carry(self._down, self._link.output(now_s))
        until_s = min(end_s, max(self._link.next_s, now_s + 1e-3)) if self._plugged else end_s
        sent = self._unit.step(feed=[said.hex()], until_s=until_s, stop_at_frame=self._plugged)
        for frame in self._witness.feed(sent):
            if isinstance(frame, Sweep):
                self.tally.made.setdefault((frame.boot, frame.sequence), frame)
        self._take(self._link.receive(self._carry(self._up, sent), self._unit.now_s))

    def _carry(self, way: BadLine, data: bytes) -> bytes:
        if not self._plugged:
            return b""
        way.write(data, self._unit.now_s)
        return way.read(self._unit.now_s)

    def _take(self, events: list[Event]) -> None:
        for event in events:
            match event:
                case SweepRead(sweep):
                    self.tally.arrived.append(sweep)
                    self._link.committed(sweep)
                case StatusRead(status):
                    self.tally.status = status
                case OrderSettled():
                    self.tally.settled.append(event)
