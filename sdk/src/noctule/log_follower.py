"""Durable reading of a site: every sweep that its gateways have logged, each delivered once, through any outage."""

import logging
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from math import inf
from time import monotonic
from types import TracebackType
from typing import Self

from noctule.bounds import MAX_UNITS
from noctule.client import Client
from noctule.errors import BusError, NoctuleError
from noctule.log_pulls import Answer, LogPulls, Standing
from noctule.messages_pb2 import Cursor, Sweep, UnitStatus
from noctule.subscription import Subscription
from noctule.unit_reader import UnitReader

LIVE_LENGTH = 500  # live sweeps held per unit; those that don't fit are read from the log
# Of all units' live sweeps, as they came; in memory they take four times as much. While deliveries hang, a flood must
# not take more.
MOST_LIVE_BYTES = 25_000_000
MOST_ANSWERS = 8  # that wait to be read, of up to 4 MB each; each thread that asks may hold one more
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

    def is_news(self, text: str) -> bool:
        """Whether the last failure since a success was another one."""
        told, self.told = self.told, text
        return text != told


class _Unit:
    """What the worker has to do for one unit."""

    def __init__(self, reader: UnitReader) -> None:
        self.reader = reader
        self.live: list[Sweep] = []
        self.behind = True  # the log may hold more than was delivered
        self.told = False  # since the last poll, by a status, how far the log goes
        self.asking = False
        self.standing = Standing.NEW
        self.delivery, self.asks = _BackOff(), _BackOff()

    @property
    def ask_due_s(self) -> float:
        """When its log is to be asked."""
        if not self.behind or self.asking:
            return inf
        return max(self.delivery.not_before_s, self.asks.not_before_s)

    @property
    def due_s(self) -> float:
        """When there is something to do for it."""
        return min(self.delivery.not_before_s if self.live else inf, self.ask_due_s)


class LogFollower:
    """Reads the logs of all units of a site and hands the sweeps to ``deliver``, on one thread of its own.

    Use it in a ``with`` statement, or start() and close() it.
    Live sweeps go first. Logs are asked several at a time, on other threads, and one that fails later and later.

    Per (unit, log_id) each sweep is delivered once, in the order of log_sequence, several of one unit at a time.
    ``deliver`` must store the sweeps and with them the cursor, which is the last one's identity, in one transaction.
    If it raises, nothing has moved, and the same sweeps come again, later and later. ``cursors`` (by unit) is what was
    stored when the process last ran. What the gateway removed before it was read is counted as lost, a record that is
    none of the log or beyond the bounds as refused, and so is each sign of a unit beyond the first MAX_UNITS.
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
        self._counts: Counter[str] = Counter(delivered=0, pulled=0, lost=0, damaged=0, refused=0, failed=0)
        self._live_bytes = 0  # of the sweeps held of all units
        lock = threading.RLock()
        self._changed, self._answer_taken = threading.Condition(lock), threading.Condition(lock)
        self._closed = self._told_too_many = False
        self._units: dict[str, _Unit] = {}
        self._due: dict[str, None] = {}  # units to see to, in the order in which they came up
        self._answers: deque[Answer] = deque()
        self._pulls = LogPulls(client.unsifted_log, self._on_answer)
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
            self._answer_taken.notify_all()
        if self._thread.is_alive():
            self._thread.join()
        self._pulls.close()

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
        """Sweeps ``delivered`` (``pulled`` from logs), ``lost``, ``damaged``, ``refused``; tries that ``failed``."""
        return dict(self._counts)

    # ---- Signs that a log holds more, on the client's thread ------------------------------------------------------

    def _on_sweep(self, sweep: Sweep) -> None:
        with self._changed:
            if unit := self._unit(sweep.unit):
                size = sweep.ByteSize()
                if len(unit.live) < LIVE_LENGTH and self._live_bytes + size <= MOST_LIVE_BYTES:
                    unit.live.append(sweep)
                    self._live_bytes += size
                else:
                    unit.behind = True
                self._see_to(sweep.unit)

    def _on_unit_status(self, status: UnitStatus) -> None:
        with self._changed:
            unit = self._unit(status.unit)
            if unit and status.log_id:
                # A log that ends before what was read has gone back, which its own answer tells.
                unit.told = unit.told or status.log_head >= unit.reader.cursor.log_sequence
                if unit.reader.is_behind(status.log_id, status.log_head):
                    unit.behind = True
                    self._see_to(status.unit)

    def _on_alive(self, name: str, alive: bool) -> None:
        if alive:
            with self._changed:
                if unit := self._unit(name):
                    unit.behind = True
                    unit.delivery.not_before_s = unit.asks.not_before_s = -inf
                    self._see_to(name)

    def _on_answer(self, answer: Answer) -> None:
        with self._changed:
            self._answer_taken.wait_for(lambda: self._closed or len(self._answers) < MOST_ANSWERS)
            self._answers.append(answer)
            self._changed.notify()

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
        self._due[name] = None
        self._changed.notify()

    # ---- Reading, on the worker thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        while self._wait():
            for name in self._take_due():
                self._attempt(name)
            if (answer := self._take_answer()) is not None:  # one: live sweeps that come meanwhile go before the next
                self._read(answer)

    def _wait(self) -> bool:
        """Wait until there is something to do; False when closed."""
        with self._changed:
            while not self._closed:
                now_s = monotonic()
                if now_s >= self._poll_at_s:
                    self._poll_at_s = now_s + self._poll_s
                    for name, unit in self._units.items():
                        if not unit.told:
                            unit.behind = True
                            self._due[name] = None
                        unit.told = False
                next_s = min([self._poll_at_s, *(self._units[name].due_s for name in self._due)])
                if self._answers or next_s <= now_s:
                    return True
                self._changed.wait(next_s - now_s)
            return False

    def _take_due(self) -> list[str]:
        """The units to see to now."""
        with self._changed:
            now_s = monotonic()
            names = [name for name in self._due if self._units[name].due_s <= now_s]
            for name in names:
                del self._due[name]
            return names

    def _take_answer(self) -> Answer | None:
        with self._changed:
            self._answer_taken.notify()
            return self._answers.popleft() if self._answers else None

    def _attempt(self, name: str) -> None:
        """Deliver what has come live, and ask the log where that is due."""
        unit = self._units[name]
        with self._changed:
            live, unit.live = unit.live, []
            self._live_bytes -= sum(sweep.ByteSize() for sweep in live)
        try:
            before = unit.reader.cursor
            if not unit.reader.take(live):
                unit.behind = True
            if unit.reader.cursor is not before:
                unit.delivery.succeeded()
        # A panic of Zenoh is no Exception, breaks the session for good, and so ends the thread.
        except Exception as error:  # whatever the store has to say, the sweeps are still in the log
            unit.behind = True
            self._tell_failed(name, error, unit.delivery)
        with self._changed:
            if unit.ask_due_s <= monotonic():
                unit.behind, unit.asking = False, True
                self._pulls.begin(name, unit.reader.cursor, unit.standing)
            elif unit.behind or unit.live:
                self._see_to(name)

    def _read(self, answer: Answer) -> None:
        """Deliver what a log has answered."""
        unit, more = self._units[answer.unit], True
        unit.asking = False
        try:
            if answer.error is not None:
                raise answer.error
            before = unit.reader.cursor
            more = answer.records is not None and unit.reader.read(answer.records, answer.asked)
            if unit.reader.cursor is not before:
                unit.delivery.succeeded()
            if answer.records is not None:
                unit.asks.succeeded()
            else:  # nobody serves the unit, or its gateway has refused the question: not at once again
                unit.asks.failed()
                unit.asks.told = ""
            unit.standing = Standing.ANSWERS
        except Exception as error:  # a panic of Zenoh is none, and ends the thread
            of_log = error is answer.error or isinstance(error, BusError)
            if of_log:
                unit.standing = Standing.FAILS
            self._tell_failed(answer.unit, error, unit.asks if of_log else unit.delivery)
        with self._changed:
            unit.behind = unit.behind or more
            if unit.behind:
                self._see_to(answer.unit)

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
