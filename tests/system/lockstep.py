"""A gateway's link and a unit's real firmware on one bad cable, in lockstep on simulated time."""

from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random
from typing import TypeVar

from firmware.stepped_unit import SteppedUnit
from gateway.bad_line import BadLine, Faults

from noctule_gateway.link.events import Event, OrderSettled, StatusRead, SweepRead
from noctule_gateway.link.link import Link
from noctule_gateway.wire.codec import FrameReader
from noctule_gateway.wire.frames import AnySweep, Order, Status

E = TypeVar("E", bound=Event)

CLEAN = Faults()
_INSTANT_S = 1e-6  # what the simulator's ticks may leave of a time


@dataclass
class Tally:
    """What has passed: ``made`` at the unit's end of the cable, before any fault, ``arrived`` out of the link."""

    made: dict[tuple[int, int], AnySweep] = field(default_factory=dict)
    arrived: list[AnySweep] = field(default_factory=list)
    status: Status | None = None
    events: list[Event] = field(default_factory=list)

    def of_type(self, kind: type[E]) -> list[E]:
        """The link's events of this kind, but for SweepRead and StatusRead."""
        return [event for event in self.events if isinstance(event, kind)]


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

    @property
    def state(self) -> int | None:
        """What the unit is doing, by its last STATUS."""
        return self.tally.status.state if self.tally.status else None

    def wait_for(self, condition: Callable[[], bool], within_s: float) -> None:
        """Let time pass until ``condition`` holds."""
        end_s = self._unit.now_s + within_s
        while not condition():
            assert self._unit.now_s < end_s - _INSTANT_S, (
                f"not within {within_s} s of simulated time: {self.tally.status}"
            )
            self._exchange(end_s)

    def carry_out(self, order: Order, within_s: float) -> None:
        """Have the unit carry ``order`` out."""
        ticket = self._link.order(order)
        self.wait_for(lambda: ticket in (each.ticket for each in self.tally.of_type(OrderSettled)), within_s)
        assert self.tally.of_type(OrderSettled)[-1].error is None

    def drained(self, within_s: float) -> Status:
        """The first status from now on that says that no sweep waits."""
        self.tally.status = None
        self.wait_for(lambda: self.tally.status is not None and not self.tally.status.sweeps_waiting, within_s)
        assert self.tally.status is not None
        return self.tally.status

    def _exchange(self, end_s: float) -> None:
        """What the link has to say goes down; then time passes until the unit has sent a frame or the link is due."""
        now_s = self._unit.now_s
        self._take(self._link.advance(now_s))
        said = self._carry(self._down, self._link.output(now_s))
        until_s = min(end_s, max(self._link.next_s, now_s + 1e-3)) if self._plugged else end_s
        sent = self._unit.step(feed=[said.hex()], until_s=until_s, stop_at_frame=self._plugged)
        for frame in self._witness.feed(sent):
            if isinstance(frame, AnySweep):
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
                    self._link.committed(sweep, self._unit.now_s)
                case StatusRead(status):
                    self.tally.status = status
                case _:
                    self.tally.events.append(event)
