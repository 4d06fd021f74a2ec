"""The link to one unit, without I/O and without a clock: bytes and times go in, bytes and events come out.

HELLO comes first, and nothing is believed of a unit that is not the one expected. Then CLOCK exchanges, quick ones at
first, STATUS, and what setup.py has to say; then all in turn, and HELLO now and again, for a reset may show in nothing
else. A sweep is acknowledged when the caller says that it is committed, and again each time it comes again.
"""

from collections import deque
from dataclasses import dataclass
from math import inf

from noctule_gateway import frames
from noctule_gateway.clock import TICK_S, Exchange
from noctule_gateway.codec import FrameReader, encode
from noctule_gateway.errors import CommandError
from noctule_gateway.events import ClockRead, Event, Identified, OrderSettled, Refused, Silent, StatusRead, SweepRead
from noctule_gateway.frames import AskClock, AskHello, AskStatus, Clock, Enquiry, Hello, Order, Result, Status, Sweep
from noctule_gateway.identity import mismatch
from noctule_gateway.receipts import Receipts, Standing
from noctule_gateway.requests import Requests
from noctule_gateway.setup import Setup, Wanted, describe

QUICK_CLOCKS = 8
CLOCK_EVERY_S = 0.97  # not in step with STATUS, nor with what a unit does once a second
STATUS_EVERY_S = 1.0
HELLO_EVERY_S = 10.0
HELLO_RETRY_S = 0.5
REFUSED_RETRY_S = 5.0
SILENT_AFTER = 6  # time-outs in a row, and not a frame between them

_BYTE_S = 10 / 115200  # 8N1
_CLOCK_ANSWER_S = len(encode(Clock(1, 0, 0))) * _BYTE_S
_SLACK_TICKS = 400_000  # frames may pass one another within the unit, but not by 0.1 s


@dataclass(frozen=True)
class _Given:
    """An order on its way; ticket 0 is the setup's."""

    order: Order
    ticket: int


class Link:
    """One unit on one line: connected() when the line is open, then receive(), advance() and output() by ``next_s``.

    Times are seconds of any one clock that never goes back.
    """

    def __init__(self, serial: int, wanted: Wanted, first_request: int) -> None:
        self.reader = FrameReader()
        self.setup = Setup(wanted)
        self.receipts = Receipts()
        self.timeouts = 0
        self.identified = False
        self._serial = serial
        self._requests = Requests(first_request)
        self._out = bytearray()
        self._boot: int | None = None
        self._setup_waits = False
        self._doubted_boots: set[int] = set()
        self._orders: deque[_Given] = deque()
        self._given: _Given | None = None
        self._tickets = 0
        self._asked_s = self._asked_through_s = 0.0
        self._greet(0.0, "")

    def connected(self, now_s: float) -> list[Event]:
        """The line has been opened, or opened again."""
        self.reader.reset()
        self._out.clear()
        return self._greet(now_s, "the line to the unit was cut")

    def receive(self, data: bytes, now_s: float) -> list[Event]:
        """Take in what came over the line."""
        return [event for frame in self.reader.feed(data) for event in self._take(frame, now_s)]

    def advance(self, now_s: float) -> list[Event]:
        """Take in that time has passed."""
        if not self._requests.overdue(now_s):
            return []
        self.timeouts += 1
        self._missed += 1
        if self.identified and self._missed >= SILENT_AFTER:
            return [*self._greet(now_s, "the unit has stopped answering"), Silent()]
        again = self._requests.repeat(now_s)
        if again is not None:
            self._out += again
            return []
        return self._settle(None, now_s) if self._given else []

    def output(self, now_s: float) -> bytes:
        """What to write to the line, at once."""
        if not self._requests.pending and now_s >= self.next_s:
            self._out += self._requests.ask(self._next_request(now_s), now_s)
            self._asked_s, self._asked_through_s = now_s, now_s + len(self._out) * _BYTE_S
        written = bytes(self._out)
        self._out.clear()
        return written

    @property
    def next_s(self) -> float:
        """When advance() and output() are due, if nothing happens before."""
        if self._requests.due_s is not None:
            return self._requests.due_s
        if not self.identified:
            return self._hello_due_s
        if self._orders or self._quick_clocks:
            return -inf
        return min(self._clock_due_s, self._status_due_s, self._hello_due_s, self.setup.due_s)

    def order(self, order: Order) -> int:
        """Have the unit carry ``order`` out; OrderSettled comes with the ticket returned. Raises CommandError."""
        if not self.identified:
            raise CommandError("the unit is not connected")
        self._tickets += 1
        self._orders.append(_Given(order, self._tickets))
        return self._tickets

    def committed(self, sweep: Sweep) -> None:
        """``sweep`` is safe: the unit may forget it."""
        self.receipts.committed(sweep)
        self._acknowledge(sweep)

    def failed(self, sweep: Sweep) -> None:
        """``sweep`` could not be committed; it is taken again when the unit sends it again."""
        self.receipts.failed(sweep)

    def _next_request(self, now_s: float) -> Enquiry | Order:
        if not self.identified or now_s >= self._hello_due_s:
            self._hello_due_s = now_s + HELLO_RETRY_S
            return AskHello(0)
        if self._quick_clocks:
            return AskClock(0)
        if self._orders or now_s >= self.setup.due_s:
            self._given = self._orders.popleft() if self._orders else _Given(self.setup.order, 0)
            return self._given.order
        if now_s >= self._status_due_s:
            self._status_due_s = now_s + STATUS_EVERY_S
            return AskStatus(0)
        self._clock_due_s = now_s + CLOCK_EVERY_S
        return AskClock(0)

    def _greet(self, now_s: float, why: str) -> list[Event]:
        """Begin again with HELLO; what was ordered and not settled fails."""
        lost = [given for given in (self._given, *self._orders) if given is not None and given.ticket]
        self._orders.clear()
        self._given = None
        self._requests.abandon()
        self.identified = False
        self._missed = 0
        self._last_tick = 0
        self._quick_clocks = QUICK_CLOCKS
        self._hello_due_s = self._clock_due_s = self._status_due_s = now_s
        return [OrderSettled(given.order, given.ticket, CommandError(why)) for given in lost]

    def _take(self, frame: frames.Frame, now_s: float) -> list[Event]:
        self._missed = 0
        if isinstance(frame, Hello):
            return self._hello(frame, now_s)
        if not self.identified:
            return []
        match frame:
            case Sweep():
                return self._sweep(frame, now_s)
            case Status() if frame.request == 0 or self._requests.answered(frame):
                return self._status(frame, now_s)
            case Clock() if self._requests.answered(frame):
                return self._clock(frame, now_s)
            case Result() if self._requests.answered(frame):
                return self._settle(frame, now_s)
        return []

    def _hello(self, hello: Hello, now_s: float) -> list[Event]:
        if hello.request != 0 and not self._requests.answered(hello):
            return []
        error = mismatch(hello, self._serial)
        if error is not None:
            lost = self._greet(now_s, str(error))
            self._hello_due_s = now_s + REFUSED_RETRY_S
            return [*lost, Refused(error)]
        rebooted = hello.boot != self._boot
        if self.identified and not rebooted:
            self._hello_due_s = now_s + HELLO_EVERY_S
            return []
        lost = self._greet(now_s, "the unit was reset")
        self._hello_due_s = now_s + HELLO_EVERY_S
        self.identified = True
        self._boot = hello.boot
        if rebooted:
            self.setup.drop()
            self._setup_waits = True
        return [*lost, Identified(hello, rebooted)]

    def _status(self, status: Status, now_s: float) -> list[Event]:
        if self._went_back(status.tick):
            return self._doubt(now_s)
        if self._setup_waits:
            self._setup_waits = False
            self.setup.begin(status)
        return [StatusRead(status)]

    def _clock(self, clock: Clock, now_s: float) -> list[Event]:
        if self._went_back(clock.sent):
            return self._doubt(now_s)
        self._quick_clocks = max(0, self._quick_clocks - 1)
        sent_s, answered_s = self._asked_through_s, now_s - _CLOCK_ANSWER_S
        if answered_s - sent_s < (clock.sent - clock.received) * TICK_S:
            sent_s, answered_s = self._asked_s, now_s  # a line that is faster than a UART
        return [ClockRead(Exchange(sent_s, clock.received, clock.sent, answered_s))]

    def _doubt(self, now_s: float) -> list[Event]:
        """What has just come may be of another boot: leave it, and ask."""
        self._hello_due_s = now_s
        return []

    def _went_back(self, tick: int) -> bool:
        went_back = tick + _SLACK_TICKS < self._last_tick
        self._last_tick = tick
        return went_back

    def _settle(self, result: Result | None, now_s: float) -> list[Event]:
        given, self._given = self._given, None
        assert given is not None
        if given.ticket == 0:
            self.setup.settle(result, now_s)
            return []
        if result is None:
            return [OrderSettled(given.order, given.ticket, CommandError("the unit did not answer"))]
        if result.result != frames.Outcome.DONE:
            return [OrderSettled(given.order, given.ticket, CommandError(describe(result)))]
        self.setup.learn(given.order)
        return [OrderSettled(given.order, given.ticket, None)]

    def _sweep(self, sweep: Sweep, now_s: float) -> list[Event]:
        if self._quick_clocks:
            return []  # its time can't be told yet; it comes again
        if self._is_newer(sweep.boot) and sweep.boot not in self._doubted_boots:
            self._doubted_boots.add(sweep.boot)
            return self._doubt(now_s)
        standing = self.receipts.arrive(sweep)
        if standing is Standing.COMMITTED:
            self._acknowledge(sweep)
        return [SweepRead(sweep)] if standing is Standing.NEW else []

    def _is_newer(self, boot: int) -> bool:
        """``boot`` is after the one of the last HELLO, as far as 16 bits can tell."""
        return self._boot is not None and 0 < (boot - self._boot) % 0x10000 < 0x8000

    def _acknowledge(self, sweep: Sweep) -> None:
        self._out += encode(frames.Ack(sweep.boot, sweep.sequence))
