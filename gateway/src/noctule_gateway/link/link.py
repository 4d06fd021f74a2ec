"""The link to one unit, without I/O and without a clock: bytes and times go in, bytes and events come out.

The states of a link and what is asked in each are in states.py. Once the unit is identified, the link asks what
enquiries.py has to ask, and orders what standing_orders.py and the caller want. A sweep is acknowledged when the caller
says that it is committed, and again each time it comes again, or may have.
"""

from collections.abc import Callable
from math import inf

from noctule_gateway.errors import CommandError
from noctule_gateway.link.enquiries import Enquiries
from noctule_gateway.link.events import (
    ClockRead,
    Event,
    Identified,
    InLoader,
    LinkCounts,
    MechanicsRead,
    Refused,
    SettingsRead,
    Silent,
    StatusRead,
    SweepRead,
)
from noctule_gateway.link.order_queue import CHANGES_SETTINGS, OrderQueue
from noctule_gateway.link.peer import BootWatch, Silence, another_unit, mismatch
from noctule_gateway.link.receipts import Receipts, Standing
from noctule_gateway.link.requests import Requests, RoundTrip
from noctule_gateway.link.standing_orders import StandingOrders, Wanted
from noctule_gateway.link.states import IDENTIFIED, TIME_IS_KNOWN, Cause, LinkState, after
from noctule_gateway.link.voucher import Voucher
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    Clock,
    Configure,
    Enquiry,
    Hello,
    Loader,
    Mechanics,
    Order,
    Outcome,
    Result,
    Settings,
    Status,
    Sweep,
)

REFUSED_RETRY_S = 5.0
LOADER_RETRY_S = 5.0

_ANOTHER_UNIT = "another unit was on the line and refused it; whether the right one has obeyed before is not known"


class Link:
    """One unit on one line: connected() when the line is open, then receive(), advance() and output() by ``next_s``.

    Times are seconds of any one clock that never goes back. ``in_turn`` gets each START that goes out, and the time; it
    gives the START with the unit's turns.
    """

    def __init__(
        self,
        serial: int,
        wanted: Wanted,
        first_request: int,
        in_turn: Callable[[frames.Start, float], frames.Start] = lambda start, _: start,
    ) -> None:
        self._reader = FrameReader()
        self._standing_orders = StandingOrders(wanted)
        self._receipts = Receipts()
        self._timeouts = 0
        self._state = LinkState.GREETING
        self._serial = serial
        self._in_turn = in_turn
        self._enquiries = Enquiries()
        self._requests = Requests(first_request)
        self._out = bytearray()
        self._boot = BootWatch()
        self._voucher = Voucher()
        self._settings: Settings | None = None
        self._settings_told = False
        self._orders = OrderQueue(self._standing_orders)
        self._round_trip = RoundTrip()
        self._silence = Silence()
        self._hushed_until_s = 0.0

    @property
    def state(self) -> LinkState:
        """How far the link has got with the unit."""
        return self._state

    @property
    def identified(self) -> bool:
        """The unit answers, and is the one expected."""
        return self._state in IDENTIFIED

    def connected(self, now_s: float, why: str = "the line to the unit was cut") -> list[Event]:
        """The line has been opened, or changes hands; what was ordered before and is not settled fails, for ``why``."""
        self._reader.reset()
        self._out.clear()
        return self._greet(now_s, why)

    def set_up_again(self) -> None:
        """Somebody else has spoken to the unit: it may not be doing what it is to do."""
        self._standing_orders.drop()
        self._go(Cause.DISTURBED)

    def receive(self, data: bytes, now_s: float) -> list[Event]:
        """Take in what came over the line."""
        bad_before = self._reader.frames_bad
        read = self._reader.feed(data)
        if self._reader.frames_bad > bad_before:
            self._garbled(now_s)
        events = [event for frame in read for event in self._take(frame, now_s)]
        return events + self._tell_settings()

    def advance(self, now_s: float) -> list[Event]:
        """Take in that time has passed."""
        return self._advance(now_s) + self._tell_settings()

    def _advance(self, now_s: float) -> list[Event]:
        if not self._requests.overdue(now_s):
            return []
        self._timeouts += 1
        self._silence.timed_out()
        if self.identified and self._silence.lasts:
            return [*self._greet(now_s, "the unit has stopped answering"), Silent()]
        if self._orders.given and not self._voucher.speaks_for_orders(now_s):
            # A HELLO now would have the unit forget the order, and do it twice if its answer was lost.
            self._requests.abandon()
            return self._settle(None, now_s)
        again = self._requests.repeat(now_s)
        if again is not None:
            self._out += again
            return []
        if self.identified and self._silence.may_be_a_pulled_plug:
            self._enquiries.greet(now_s)  # another unit's plug may have been put in
        return self._settle(None, now_s) if self._orders.given else []

    def output(self, now_s: float) -> bytes:
        """What to write to the line, at once. Nothing while a unit stores its settings, for then it hears nothing."""
        if self._requests.pending and now_s < self._hushed_until_s:
            return b""
        if not self._requests.pending and now_s >= self.next_s:
            request = self._next_request(now_s)
            request = self._in_turn(request, now_s) if isinstance(request, frames.Start) else request
            self._out += self._requests.ask(request, now_s)
            self._round_trip.asked(now_s, len(self._out))
        if isinstance(self._orders.given, frames.Store) and self._requests.due_s is not None:
            self._hushed_until_s = self._requests.due_s
        written = bytes(self._out)
        self._out.clear()
        return written

    @property
    def next_s(self) -> float:
        """When advance() and output() are due, if nothing happens before."""
        if self._requests.due_s is not None:
            return self._requests.due_s
        if not self.identified:
            return self._enquiries.hello_due_s
        if self._state is LinkState.SYNCING:
            return -inf
        return min(self._enquiries.due_s, self._orders.due_s)

    def order(self, order: Order) -> int:
        """Have the unit carry ``order`` out; OrderSettled comes with the ticket returned. Raises CommandError."""
        if not self.identified:
            raise CommandError("the unit is not connected: noctule units SITE says why")
        ticket = self._orders.add(order)
        self._tell_settings()
        return ticket

    def withdraw(self, ticket: int) -> None:
        """Don't give the order of this ticket any more, if it still waits: no OrderSettled comes of it then."""
        self._orders.withdraw(ticket)

    def start_again(self) -> None:
        """Tell the unit once more how it is started, if it is: its turns have changed."""
        if self._state is LinkState.SERVING:
            self._standing_orders.start_again()

    @property
    def settings(self) -> Settings | None:
        """As the unit has them; None until they have been read, and as long as an order that changes them is under way.

        ``plan_to_give`` is not in them.
        """
        return None if self._standing_orders.awaits_status or self._orders.changes_settings else self._settings

    @property
    def plan_to_give(self) -> Configure | None:
        """The plan of the standing orders, as long as the unit has not got it."""
        return self._standing_orders.plan_to_give

    @property
    def setup_error(self) -> str:
        """Which standing order the unit refused; empty if it refused none."""
        return self._standing_orders.error

    @property
    def counts(self) -> LinkCounts:
        """What was counted so far."""
        read = self._reader
        repeated = self._receipts.duplicates
        return LinkCounts(read.frames_read, read.frames_bad, read.frames_unknown, repeated, self._timeouts)

    def committed(self, sweep: frames.AnySweep, now_s: float) -> None:
        """``sweep`` is safe: the unit may forget it."""
        self._receipts.committed(sweep)
        self._acknowledge(sweep, now_s)

    def failed(self, sweep: frames.AnySweep) -> None:
        """``sweep`` could not be committed; it is taken again when the unit sends it again."""
        self._receipts.failed(sweep)

    def _next_request(self, now_s: float) -> Enquiry | Order:
        ordered = now_s >= self._orders.due_s
        vouched = self._voucher.speaks_for_orders(now_s)
        if ordered and not vouched:
            self._enquiries.greet_soon(now_s)
        urgent = self._enquiries.urgent(now_s)
        if urgent is not None:
            return urgent
        return self._orders.give() if ordered and vouched else self._enquiries.routine(now_s)

    def _go(self, cause: Cause) -> None:
        self._state = after(self._state, cause)

    def _go_on(self) -> None:
        """See whether what the state waits for has come about."""
        if self._state is LinkState.SYNCING and self._enquiries.time_is_known:
            self._go(Cause.TIME_KNOWN)
        if self._state is LinkState.SETTING_UP and self._standing_orders.done:
            self._go(Cause.SET_UP)

    def _greet(self, now_s: float, why: str, again_s: float = 0.0) -> list[Event]:
        """Begin again with HELLO, ``again_s`` from now; what was ordered and not settled fails."""
        self._go(Cause.LOST)
        self._voucher.withdrawn()
        self._enquiries.greet(now_s + again_s)
        return self._forget(why)

    def _forget(self, why: str) -> list[Event]:
        """Await nothing of what was asked so far."""
        self._requests.abandon()
        self._settings = None
        self._silence.broken()
        return self._orders.fail(why)

    def _garbled(self, now_s: float) -> None:
        """Somebody is there, behind a bad line. It may have been a sweep whose acknowledgement was lost."""
        self._silence.garbled()
        if self.identified and (sweep := self._receipts.to_acknowledge_again(now_s)) is not None:
            self._acknowledge(sweep, now_s)

    def _take(self, frame: frames.Frame, now_s: float) -> list[Event]:
        self._silence.broken()
        match frame:
            case Hello() | Loader() if frame.request == 0 or self._requests.answered(frame):
                return self._met(frame, now_s)
        if not self.identified:
            return []
        match frame:
            case Sweep() | frames.Sweep2():
                return self._sweep(frame, now_s)
            case Status() if frame.request == 0 or self._requests.answered(frame):
                return self._status(frame, now_s)
            case Clock() if self._requests.answered(frame):
                return self._clock(frame, now_s)
            case Settings() if self._requests.answered(frame):
                self._settings = frame
                self._enquiries.settings_came()
            case Mechanics() if self._requests.answered(frame):
                self._enquiries.mechanics_came()
                return [MechanicsRead(frame)]
            case Result(result=Outcome.NOT_FOR_THIS_UNIT) if self._requests.answered(frame):
                return self._greet(now_s, _ANOTHER_UNIT)
            case Result() if self._requests.answered(frame):
                return self._settle(frame, now_s)
        return []

    def _met(self, frame: Hello | Loader, now_s: float) -> list[Event]:
        error = mismatch(frame, self._serial)
        if error is not None:
            return [*self._greet(now_s, str(error), REFUSED_RETRY_S), Refused(error)]
        return self._loader(frame, now_s) if isinstance(frame, Loader) else self._hello(frame, now_s)

    def _loader(self, loader: Loader, now_s: float) -> list[Event]:
        self._go(Cause.LOADER)
        self._enquiries.greet(now_s + LOADER_RETRY_S)
        return [*self._forget("the unit is in its loader"), InLoader(loader)]

    def _hello(self, hello: Hello, now_s: float) -> list[Event]:
        self._enquiries.greeted(now_s)
        self._voucher.greeted(hello, now_s)
        self._requests.address(self._voucher.addressee)
        rebooted = self._boot.is_another(hello.boot_of_life)
        if self.identified and not rebooted:
            return []
        done = self._orders.unit_was_reset() if rebooted else []
        lost = self._forget("the unit was reset")
        self._go(Cause.HELLO)
        self._enquiries.begin(now_s, rebooted, hello.knows_mechanics)
        if rebooted:
            self._boot.begin(hello.boot_of_life)
            self._standing_orders.drop()
        return [*done, *lost, Identified(hello, rebooted)]

    def _status(self, status: Status, now_s: float) -> list[Event]:
        if self._boot.refuted_by_tick(status.tick):
            return self._doubt(now_s)
        self._enquiries.status_came(status, now_s)
        if self._standing_orders.awaits_status:
            self._standing_orders.begin(status)
            self._go_on()
        return [StatusRead(status)]

    def _clock(self, clock: Clock, now_s: float) -> list[Event]:
        if self._boot.refuted_by_tick(clock.sent):
            return self._doubt(now_s)
        self._enquiries.clock_came()
        self._go_on()
        return [ClockRead(self._round_trip.exchange(clock, now_s))]

    def _doubt(self, now_s: float) -> list[Event]:
        """What has just come may be of another boot: leave it, and ask."""
        self._enquiries.greet(now_s)
        return []

    def _settle(self, result: Result | None, now_s: float) -> list[Event]:
        if result is not None and isinstance(self._orders.given, CHANGES_SETTINGS):
            self._settings = None
            self._enquiries.settings_changed(now_s)
        events = self._orders.settle(result, now_s)
        self._go_on()
        return events

    def _tell_settings(self) -> list[Event]:
        told, self._settings_told = self._settings_told, self.settings is not None
        return [SettingsRead()] if self._settings_told and not told else []

    def _sweep(self, sweep: frames.AnySweep, now_s: float) -> list[Event]:
        error = another_unit(sweep, self._serial) if isinstance(sweep, Sweep) else None
        if error is not None:
            return [*self._greet(now_s, str(error)), Refused(error)]
        if self._state not in TIME_IS_KNOWN:
            return []  # it comes again
        if not self._voucher.speaks_for(sweep, now_s) or self._boot.doubted_by_sweep(sweep.boot_of_life):
            return self._doubt(now_s)
        standing = self._receipts.arrive(sweep)
        if standing is Standing.COMMITTED:
            self._acknowledge(sweep, now_s)
        return [SweepRead(sweep)] if standing is Standing.NEW else []

    def _acknowledge(self, sweep: frames.AnySweep, now_s: float) -> None:
        if self._voucher.speaks_for(sweep, now_s):  # otherwise it comes again
            self._receipts.acknowledged(sweep)
            self._out += encode(self._voucher.acknowledgement(sweep))
