"""Reading one unit's log with its newest sweeps first, so that a long history behind them holds up nothing new."""

from collections import Counter
from collections.abc import Callable, Sequence

from noctule.messages_pb2 import Cursor, LogRecords, Sweep
from noctule.unit_reader import UnitReader

FAR_BEHIND = 500  # more sweeps than one reply of a log holds
NEWEST = 32  # of a unit that sweeps from one place, more than a map keeps
# The history is read so far past the place where the newest began: a sweep may say that those before it are suspect.
_OVERLAP = 64


class NewestFirst:
    """A reader of one unit that delivers every sweep in order, and of a log that it is far behind the newest before.

    As UnitReader; ``deliver_ahead`` takes sweeps for good too, but the cursor stays: they come again in their order,
    if the history behind them has not all been read when the process ends.
    """

    def __init__(
        self,
        unit: str,
        cursor: Cursor | None,
        deliver: Callable[[Sequence[Sweep]], None],
        deliver_ahead: Callable[[Sequence[Sweep]], None],
        counts: Counter[str],
    ) -> None:
        self._in_order = UnitReader(unit, cursor, deliver, counts)
        self._ahead: UnitReader | None = None
        self._deliver_ahead, self._counts = deliver_ahead, counts
        self._began = 0  # the log_sequence of the first one that was read ahead
        self._newest_due = self._asked_ahead = False

    @property
    def cursor(self) -> Cursor:
        """The last sweep up to which all were delivered."""
        return self._in_order.cursor

    @property
    def reached(self) -> tuple[Cursor, ...]:
        """It changes with each delivery."""
        return self.cursor, self._foremost.cursor

    def ask_after(self) -> Cursor:
        """After which sweep the log is to be asked now."""
        self._asked_ahead = self._ahead is not None and self._newest_due
        return self._ahead.cursor if self._ahead is not None and self._asked_ahead else self._in_order.cursor

    def is_behind(self, log_id: str, head: int) -> bool:
        """Whether a log with that head holds more than was delivered."""
        behind = self._foremost.is_behind(log_id, head)
        self._newest_due = self._newest_due or behind
        return behind or self._ahead is not None

    def take(self, live: Sequence[Sweep]) -> bool:
        """Deliver those of ``live`` that follow on; False where the log must be asked for what lies between."""
        if self._foremost.take(live):
            return True
        self._newest_due = True
        return False

    def read(self, records: LogRecords, asked: Cursor) -> bool:
        """Deliver what a reply of the log holds, asked for when ask_after() gave ``asked``; whether the log has more.

        Raises BusError, and what ``deliver`` and ``deliver_ahead`` raise.
        """
        if self._ahead is None:
            more = self._in_order.read(records, asked)
            if records.head - self.cursor.log_sequence > FAR_BEHIND:
                self._run_ahead(records)
            return more
        if records.log_id != self.cursor.log_id:  # another log: nothing is known of its history
            self._ahead = None
            return self._in_order.read(records, asked)
        if self._asked_ahead:
            self._newest_due = self._ahead.read(records, asked)
            return True
        self._in_order.read(records, asked)
        self._newest_due = self._newest_due or records.head > self._ahead.cursor.log_sequence
        if self.cursor.log_sequence < min(self._began + _OVERLAP, self._ahead.cursor.log_sequence):
            return True
        self._in_order.cursor, self._ahead = max(self.cursor, self._ahead.cursor, key=_sequence), None
        return self.cursor.log_sequence < records.head

    @property
    def _foremost(self) -> UnitReader:
        return self._ahead or self._in_order

    def _run_ahead(self, records: LogRecords) -> None:
        self._began, self._newest_due = records.head - NEWEST + 1, True
        before = Cursor(unit=self._in_order.unit, log_id=records.log_id, log_sequence=records.head - NEWEST)
        self._ahead = UnitReader(self._in_order.unit, before, self._deliver_ahead, self._counts)


def _sequence(cursor: Cursor) -> int:
    return cursor.log_sequence
