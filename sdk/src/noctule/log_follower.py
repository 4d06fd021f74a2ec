"""Durable reading of a site: every sweep that its gateways have logged, each delivered once, through any outage."""

import logging
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import inf
from time import monotonic
from types import TracebackType
from typing import Self

import zenoh

from noctule.bounds import MAX_UNITS
from noctule.client import Client, LogReply
from noctule.errors import BusError, NoctuleError
from noctule.messages_pb2 import Cursor, Sweep, UnitStatus
from noctule.subscription import Subscription
from noctule.unit_reader import UnitReader

MOST_RECORDS = 8000  # in the answers to all questions that are under way
# A question's share of these, by how many are under way when it is asked; at least FEW, at most PAGE.
FEW, PAGE = 20, 500
MOST_BYTES = 25_000_000  # of answers that wait to be read; one that does not fit is asked for again
FIRST_RETRY_S = 0.1
LAST_RETRY_S = 10.0

_log = logging.getLogger(__name__)


class _BackOff:
    """When to try again after failures, later and later."""

    def __init__(self) -> None:
        self.not_before_s = -inf
        self._retry_s = FIRST_RETRY_S
        self.told = ""  # the last failure since a success

    def succeeded(self) -> None:
        self.not_before_s, self._retry_s, self.told = -inf, FIRST_RETRY_S, ""

    def failed(self) -> float:
        """Seconds until the next try."""
        wait_s, self._retry_s = self._retry_s, min(2.0 * self._retry_s, LAST_RETRY_S)
        self.not_before_s = monotonic() + wait_s
        return wait_s

    def pause(self) -> None:
        """Not at once again, though nothing failed."""
        self.not_before_s = monotonic() + FIRST_RETRY_S

    def is_news(self, text: str) -> bool:
        """Whether the last failure since a success was another one."""
        told, self.told = self.told, text
        return text != told


class _Unit:
    """What the worker has to do for one unit."""

    def __init__(self, reader: UnitReader) -> None:
        self.reader = reader
        self.doubtful = True  # nobody knows how far the log goes
        self.sign: tuple[str, int] | None = None  # since its log was last asked: a log_id and how far that goes
        self.told = False  # since the last poll, by a status, how far the log goes
        self.asking = False  # until the answer is read
        self.delivery, self.asks = _BackOff(), _BackOff()

    def hear(self, log_id: str, head: int) -> None:
        """Somebody says that a log goes so far."""
        known = self.sign is not None and self.sign[0] == log_id and self.sign[1] >= head
        if not known and self.reader.is_behind(log_id, head):
            self.sign = log_id, head

    @property
    def due_s(self) -> float:
        """When its log is to be asked."""
        if self.asking or not (self.doubtful or (self.sign and self.reader.is_behind(*self.sign))):
            return inf
        return max(self.delivery.not_before_s, self.asks.not_before_s)


class LogFollower:
    """Reads the logs of all units of a site and hands the sweeps to ``deliver``, on one thread of its own.

    Use it in a ``with`` statement, or start() and close() it.
    A live sweep has its log asked at once, and what the log answers is delivered: a stranger can publish a sweep as
    well. Each unit has one question under way at most; one that fails is asked again later and later. Nothing waits for
    a log that is silent.

    Per (unit, log_id) each sweep is delivered once, in the order of log_sequence, several of one unit at a time.
    ``deliver`` must store the sweeps and with them the cursor, which is the last one's identity, in one transaction.
    If it raises, nothing has moved, and the same sweeps come again, later and later. ``cursors`` (by unit) is what was
    stored when the process last ran. What the gateway removed before it was read is counted as lost, a record that is
    none of the log or beyond the bounds as refused, and so are a live sweep that is not in its log and each sign of a
    unit beyond the first MAX_UNITS.
    """

    def __init__(
        self,
        client: Client,
        deliver: Callable[[Sequence[Sweep]], None],
        cursors: Mapping[str, Cursor],
        poll_s: float = 10.0,
    ) -> None:
        """``poll_s``: after so long without a status of its unit each log is asked whether it holds more."""
        self._client = client
        self._deliver = deliver
        self._poll_s = poll_s
        self._counts: Counter[str] = Counter(delivered=0, lost=0, damaged=0, refused=0, failed=0)
        self._changed = threading.Condition()
        self._closed = self._told_too_many = False
        self._units: dict[str, _Unit] = {}
        self._due: dict[str, None] = {}  # units to see to, in the order in which they came up
        self._asking = 0  # questions under way, and answers that are not read
        self._answers: dict[str, tuple[LogReply, int]] = {}  # by unit, with its bytes
        self._answer_bytes, self._shortest_next = 0, True
        self._poll_at_s = monotonic() + poll_s
        self._thread = threading.Thread(target=self._run, name=f"noctule-follow-{client.site}", daemon=True)
        self._subscriptions: list[Subscription] = []
        with self._changed:
            for name, cursor in cursors.items():
                self._unit(name, cursor)

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()
        self._subscriptions += [
            self._client.on_sweep(self._on_sweep),
            self._client.on_unit_status(self._on_unit_status),
            self._client.on_alive(self._on_alive),
        ]

    def close(self) -> None:
        """Read no more; a delivery that has begun is finished first."""
        for subscription in self._subscriptions:
            subscription.undeclare()
        self._subscriptions.clear()
        with self._changed:
            self._closed = True
            self._changed.notify()
        if self._thread.is_alive():
            self._thread.join()

    def cursors(self) -> dict[str, Cursor]:
        """By unit, the last sweep that was delivered; units whose log was never reached are left out."""
        with self._changed:
            found = {name: unit.reader.cursor for name, unit in self._units.items()}
        return {name: cursor for name, cursor in found.items() if cursor.log_id}

    def unread(self) -> dict[str, str]:
        """By unit, why its log can't be read, while it can't."""
        with self._changed:
            return {name: unit.asks.told for name, unit in sorted(self._units.items()) if unit.asks.told}

    def counters(self) -> dict[str, int]:
        """Sweeps ``delivered``, ``lost``, ``damaged``, ``refused``; tries that ``failed``."""
        return dict(self._counts)

    # ---- Signs that a log holds more, on the client's thread ------------------------------------------------------

    def _on_sweep(self, sweep: Sweep) -> None:
        with self._changed:
            if unit := self._unit(sweep.unit):
                unit.reader.strangers.note(sweep)
                unit.hear(sweep.log_id, sweep.log_sequence)
        self._ask_if_due(sweep.unit)  # without waiting for the worker

    def _on_unit_status(self, status: UnitStatus) -> None:
        with self._changed:
            unit = self._unit(status.unit)
            if unit and status.log_id:
                # A log that ends before what was read has gone back, which its own answer tells.
                unit.told = unit.told or status.log_head >= unit.reader.cursor.log_sequence
                unit.hear(status.log_id, status.log_head)
                self._see_to(status.unit)

    def _on_alive(self, name: str, alive: bool) -> None:
        if alive:
            with self._changed:
                if unit := self._unit(name):
                    unit.doubtful = True
                    unit.delivery.not_before_s = unit.asks.not_before_s = -inf
                    self._see_to(name)

    def _on_answer(self, name: str, answer: LogReply) -> None:
        """On Zenoh's thread, which never waits."""
        reply = None if answer.exception() else answer.result()
        size_bytes = len(reply.payload) if reply else 0
        with self._changed:
            if self._answer_bytes and self._answer_bytes + size_bytes > MOST_BYTES:
                self._units[name].asks.failed()
                self._end_question(name, more=True)
            else:
                self._answers[name] = answer, size_bytes
                self._answer_bytes += size_bytes
                self._changed.notify()

    def _end_question(self, name: str, more: bool) -> None:
        unit = self._units[name]
        self._asking -= 1
        unit.asking, unit.doubtful = False, unit.doubtful or more
        self._see_to(name)

    def _unit(self, name: str, cursor: Cursor | None = None) -> _Unit | None:
        """The unit; None where there are too many: somebody makes up names."""
        if name not in self._units:
            if len(self._units) >= MAX_UNITS:
                self._refuse(name)
                return None
            self._units[name] = _Unit(UnitReader(name, cursor, self._deliver, self._counts))
            self._see_to(name)
        return self._units[name]

    def _refuse(self, name: str) -> None:
        if not self._told_too_many:
            self._told_too_many = True
            _log.error("more than %d units: %s is not read, and neither are others that come", MAX_UNITS, name)
        self._counts["refused"] += 1

    def _see_to(self, name: str) -> None:
        if self._units[name].due_s < inf:
            self._due[name] = None
            self._changed.notify()

    # ---- Reading, on the worker thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        while self._wait():
            for name in self._due_now():
                self._ask_if_due(name)
            if (answer := self._take_answer()) is not None:
                self._read(*answer)

    def _wait(self) -> bool:
        """Wait until there is something to do; False when closed."""
        with self._changed:
            while not self._closed:
                now_s = monotonic()
                if now_s >= self._poll_at_s:
                    self._poll_at_s = now_s + self._poll_s
                    for name, unit in self._units.items():
                        if not unit.told:
                            unit.doubtful = True
                            self._due[name] = None
                        unit.told = False
                next_s = min([self._poll_at_s, *(self._units[name].due_s for name in self._due)])
                if self._answers or next_s <= now_s:
                    return True
                self._changed.wait(next_s - now_s)
            return False

    def _due_now(self) -> list[str]:
        with self._changed:
            now_s = monotonic()
            return [name for name in self._due if self._units[name].due_s <= now_s]

    def _take_answer(self) -> tuple[str, LogReply] | None:
        """The oldest or, every other time, the shortest: what has just been swept waits for one long answer at most."""
        with self._changed:
            if not self._answers:
                return None
            shortest = min(self._answers, key=lambda name: self._answers[name][1])
            name = shortest if self._shortest_next else next(iter(self._answers))
            self._shortest_next = not self._shortest_next
            answer, size_bytes = self._answers.pop(name)
            self._answer_bytes -= size_bytes
            return name, answer

    def _ask_if_due(self, name: str) -> None:
        with self._changed:
            if not (unit := self._units.get(name)):
                return
            if unit.due_s > monotonic():
                self._see_to(name)
                return
            self._due.pop(name, None)
            self._asking += 1
            unit.asking, unit.doubtful, unit.sign = True, False, None
            unit.reader.strangers.ask()
            share = max(FEW, min(MOST_RECORDS // self._asking, PAGE))
        try:
            answer = self._client.ask_log(name, unit.reader.cursor.log_sequence + 1, share)
        except zenoh.ZError as error:  # the session is closed
            answer = LogReply()
            answer.set_exception(BusError(str(error)))
        answer.add_done_callback(partial(self._on_answer, name))

    def _read(self, name: str, answer: LogReply) -> None:
        """Deliver what a log has answered."""
        unit, more = self._units[name], True
        before = unit.reader.cursor
        try:
            records = self._client.log_records(answer.result())
            more = records is not None and unit.reader.read(records)
            if records is None:  # nobody serves the unit, or its gateway has refused the question: not at once again
                unit.asks.failed()
                unit.asks.told = ""
            else:
                unit.asks.succeeded()
                if unit.reader.cursor is not before:
                    unit.delivery.succeeded()
                else:  # somebody may make up signs without end
                    unit.asks.pause()
        except BusError as error:
            self._tell_failed(name, error, unit.asks)
        # A panic of Zenoh is no Exception, breaks the session for good, and so ends the thread.
        except Exception as error:  # whatever the store has to say, the sweeps are still in the log
            self._tell_failed(name, error, unit.delivery)
        with self._changed:
            self._end_question(name, more)

    def _tell_failed(self, name: str, error: Exception, back_off: _BackOff) -> None:
        self._counts["failed"] += 1
        wait_s = back_off.failed()
        if back_off.is_news(str(error)):
            _log.warning(
                "unit %s: not read (%s); again in %.1f s, then ever later up to %g s",
                name,
                error,
                wait_s,
                LAST_RETRY_S,
                exc_info=not isinstance(error, NoctuleError),
            )
