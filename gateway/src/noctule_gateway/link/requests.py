"""One request to a unit at a time: its number, its time-out, and its repeats.

A unit does not carry out again the request that it has just answered. So an order is repeated under its own number
until it is answered, and nothing else is asked meanwhile; an enquiry that stays unanswered is dropped, and the next
one gets a number of its own.
"""

from dataclasses import dataclass, replace

from noctule_gateway.clock.regression import TICK_S, Exchange
from noctule_gateway.wire.codec import encode
from noctule_gateway.wire.frames import (
    MAX_REQUEST,
    AskClock,
    AskHello,
    AskMechanics,
    AskSettings,
    AskStatus,
    Clock,
    Enquiry,
    For,
    Hello,
    Loader,
    Mechanics,
    Order,
    Result,
    Settings,
    Status,
)

TIMEOUT_S = 0.5
ORDER_ATTEMPTS = 8

_BYTE_S = 10 / 115200  # 8N1
_ANSWER_S = len(encode(Clock(1, 0, 0))) * _BYTE_S

Answer = Hello | Loader | Status | Clock | Settings | Mechanics | Result

_ANSWERS = {
    AskHello: (Hello, Loader),
    AskStatus: Status,
    AskClock: Clock,
    AskSettings: Settings,
    AskMechanics: Mechanics,
}


@dataclass(frozen=True)
class _Pending:
    frame: Enquiry | Order
    attempts: int
    due_s: float


class Requests:
    """Numbers what is asked, from ``first`` on, and tells what an answer belongs to.

    ``first`` should differ from one run to the next: the unit may remember the last request of the run before.
    """

    def __init__(self, first: int) -> None:
        self._number = first % MAX_REQUEST
        self._addressee: tuple[int, int] | None = None
        self._pending: _Pending | None = None

    @property
    def pending(self) -> bool:
        """An answer is awaited."""
        return self._pending is not None

    @property
    def due_s(self) -> float | None:
        """When the awaited answer is overdue."""
        return self._pending.due_s if self._pending else None

    def ask(self, frame: Enquiry | Order, now_s: float) -> bytes:
        """The bytes to write for a new request. Nothing else may be pending."""
        assert self._pending is None
        self._number = self._number % MAX_REQUEST + 1
        return self._send(replace(frame, request=self._number), 1, now_s)

    def answered(self, answer: Answer) -> Enquiry | Order | None:
        """The request that ``answer`` settles; None if it is not the one awaited."""
        if self._pending is None:
            return None
        frame = self._pending.frame
        if answer.request != frame.request or not isinstance(answer, _ANSWERS.get(type(frame), Result)):
            return None
        if isinstance(answer, Result) and answer.command != frame.TYPE:
            return None
        self._pending = None
        return frame

    def overdue(self, now_s: float) -> bool:
        """The awaited answer should have come."""
        return self._pending is not None and now_s >= self._pending.due_s

    def repeat(self, now_s: float) -> bytes | None:
        """The bytes to write once more for an overdue order; None if it is given up, as an enquiry is at once."""
        assert self._pending is not None
        frame, attempts = self._pending.frame, self._pending.attempts
        if isinstance(frame, Enquiry) or attempts >= ORDER_ATTEMPTS:
            self._pending = None
            return None
        return self._send(frame, attempts + 1, now_s)

    def abandon(self) -> None:
        """Await nothing any more."""
        self._pending = None

    def address(self, addressee: tuple[int, int] | None) -> None:
        """Orders name this unit (serial number and life) from now on; None for a unit that knows no such orders."""
        self._addressee = addressee

    def _send(self, frame: Enquiry | Order, attempts: int, now_s: float) -> bytes:
        self._pending = _Pending(frame, attempts, now_s + TIMEOUT_S)
        if self._addressee is not None and isinstance(frame, Order):
            return encode(For(*self._addressee, frame))
        return encode(frame)


class RoundTrip:
    """The latest request: asked(), then exchange() with its answer."""

    def __init__(self) -> None:
        self._asked_s = self._asked_through_s = 0.0

    def asked(self, now_s: float, size_bytes: int) -> None:
        """So many bytes begin to go out, of which the request's are the last."""
        self._asked_s, self._asked_through_s = now_s, now_s + size_bytes * _BYTE_S

    def exchange(self, clock: Clock, now_s: float) -> Exchange:
        """The exchange that the answer ``clock``, whose last byte has just come, completes."""
        sent_s, answered_s = self._asked_through_s, now_s - _ANSWER_S
        if answered_s - sent_s < (clock.sent - clock.received) * TICK_S:
            sent_s, answered_s = self._asked_s, now_s  # a line that is faster than a UART
        return Exchange(sent_s, clock.received, clock.sent, answered_s)
