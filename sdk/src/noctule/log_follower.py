"""Durable reading of a site: every sweep that its gateways have logged, each delivered once, through any outage."""

import logging
import threading
from collections import Counter, deque
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from types import TracebackType
from typing import Self

from noctule.client import Client
from noctule.errors import BusError
from noctule.messages_pb2 import Cursor, LogRecords, Sweep, UnitStatus
from noctule.subscription import Subscription
from noctule.unit_reader import UnitReader

LIVE_LENGTH = 500  # live sweeps held per unit; those that don't fit are read from the log
FIRST_RETRY_S = 0.1
LAST_RETRY_S = 10.0

_log = logging.getLogger(__name__)


class _Unit:
    """What the worker has to do for one unit."""

    def __init__(self, reader: UnitReader) -> None:
        self.reader = reader
        self.live: deque[Sweep] = deque(maxlen=LIVE_LENGTH)
        self.behind = True  # the log may hold more than was delivered
        self.retry_s = FIRST_RETRY_S
        self.not_before_s = 0.0


class LogFollower:
    """Reads the logs of all units of a site and hands the sweeps to ``deliver``, on one thread of its own.

    Use it in a ``with`` statement, or start() and close() it.

    Per (unit, log_id) each sweep is delivered once, in the order of log_sequence, several of one unit at a time.
    ``deliver`` must store the sweeps and with them the cursor, which is the last one's identity, in one transaction.
    If it raises, nothing has moved, and the same sweeps come again, later and later. ``cursors`` (by unit) is what was
    stored when the process last ran. What the gateway removed before it was read is counted as lost, a record that is
    none of the log or beyond the bounds as refused.
    """

    def __init__(
        self,
        client: Client,
        deliver: Callable[[Sequence[Sweep]], None],
        cursors: Mapping[str, Cursor],
        poll_s: float = 10.0,
    ) -> None:
        """``poll_s``: how often each log is asked without a sign that it holds more, for signs may be lost."""
        self._client = client
        self._deliver = deliver
        self._poll_s = poll_s
        self._counts: Counter[str] = Counter(delivered=0, pulled=0, lost=0, damaged=0, refused=0, failed=0)
        self._changed = threading.Condition()
        self._closed = False
        self._units: dict[str, _Unit] = {}
        self._due: dict[str, None] = {}  # units to see to, in the order in which they came up
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

    def counters(self) -> dict[str, int]:
        """Sweeps ``delivered`` (``pulled`` from logs), ``lost``, ``damaged``, ``refused``; tries that ``failed``."""
        return dict(self._counts)

    # ---- Signs that a log holds more, on the client's thread ------------------------------------------------------

    def _on_sweep(self, sweep: Sweep) -> None:
        with self._changed:
            self._unit(sweep.unit).live.append(sweep)
            self._see_to(sweep.unit)

    def _on_unit_status(self, status: UnitStatus) -> None:
        with self._changed:
            unit = self._unit(status.unit)
            if status.log_id and unit.reader.is_behind(status.log_id, status.log_head):
                unit.behind = True
                self._see_to(status.unit)

    def _on_alive(self, name: str, alive: bool) -> None:
        if alive:
            with self._changed:
                unit = self._unit(name)
                unit.behind = True
                unit.not_before_s = 0.0
                self._see_to(name)

    def _unit(self, name: str, cursor: Cursor | None = None) -> _Unit:
        if name not in self._units:
            self._units[name] = _Unit(UnitReader(name, cursor, self._ask, self._deliver, self._counts))
            self._see_to(name)
        return self._units[name]

    def _see_to(self, name: str) -> None:
        self._due[name] = None
        self._changed.notify()

    # ---- Reading, on the worker thread ----------------------------------------------------------------------------

    def _run(self) -> None:
        while names := self._next():
            for name in names:
                self._attempt(name)

    def _next(self) -> list[str]:
        """Wait until there are units to see to; none when closed."""
        with self._changed:
            while not self._closed:
                now_s = monotonic()
                if now_s >= self._poll_at_s:
                    self._poll_at_s = now_s + self._poll_s
                    for name, unit in self._units.items():
                        unit.behind = True
                        self._due[name] = None
                if names := [name for name in self._due if self._units[name].not_before_s <= now_s]:
                    for name in names:
                        del self._due[name]
                    return names
                waits = [self._units[name].not_before_s for name in self._due]
                self._changed.wait(min([self._poll_at_s, *waits]) - now_s)
            return []

    def _attempt(self, name: str) -> None:
        unit = self._units[name]
        with self._changed:
            live = list(unit.live)
            unit.live.clear()
            behind, unit.behind = unit.behind, False
        try:
            all_taken = unit.reader.take(live)
            more = (behind or not all_taken) and unit.reader.ask_log()
            unit.retry_s = FIRST_RETRY_S
        # A panic of Zenoh is no Exception, breaks the session for good, and so ends the thread.
        except Exception as error:  # whatever the store or the bus has to say, the sweeps are still in the log
            self._counts["failed"] += 1
            _log.warning(
                "unit %s: not read (%s); again in %.1f s",
                name,
                error,
                unit.retry_s,
                exc_info=not isinstance(error, BusError),
            )
            unit.not_before_s = monotonic() + unit.retry_s
            unit.retry_s = min(2.0 * unit.retry_s, LAST_RETRY_S)
            more = True
        if more:
            with self._changed:
                unit.behind = True
                self._see_to(name)

    def _ask(self, unit: str, from_sequence: int) -> LogRecords | None:
        return self._client.unsifted_log(unit, from_sequence)
