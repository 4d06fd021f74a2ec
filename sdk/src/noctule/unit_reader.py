"""How far one unit's log has been read: every sweep handed on once, in order, whatever the bus loses or repeats.

What counts is what the log answers. A sweep that comes live only says that the log holds more.
"""

import logging
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence

from noctule.errors import BusError
from noctule.messages_pb2 import Cursor, LogGap, LogRecords, Sweep
from noctule.strangers import Strangers
from noctule.unit_records import sift

MAX_LOGS_LEFT = 16  # of a unit, that a reader could go on with; a unit has one new log where a disk was replaced

_log = logging.getLogger(__name__)


class UnitReader:
    """Reads one unit's log and hands on each sweep just once. One question at a time: read() its answer, then the next.

    ``deliver`` takes sweeps for good, or raises, and then nothing has moved. ``counts`` gets ``delivered``, ``lost``,
    ``damaged`` (the log itself has lost them to damage) and ``refused``.
    """

    def __init__(
        self,
        unit: str,
        cursor: Cursor | None,
        deliver: Callable[[Sequence[Sweep]], None],
        counts: Counter[str],
    ) -> None:
        self.unit = unit
        self.cursor = cursor or Cursor(unit=unit)  # the last sweep delivered; replaced, never changed
        self._deliver = deliver
        self._counts = counts
        self._left: dict[str, Cursor] = {}  # where other logs of this unit were left, should one come back
        self._taken_before = range(0)  # sequences that were delivered, and that the log then had still to give
        self.strangers = Strangers(unit, counts)
        self._turns = 0  # to another log, since one last gave what was asked of it

    def is_behind(self, log_id: str, head: int) -> bool:
        """Whether a log with that head holds more than was delivered."""
        return log_id != self.cursor.log_id or head > self.cursor.log_sequence

    def read(self, records: LogRecords) -> bool:
        """Deliver what a reply of the log holds, asked for from the cursor on; whether the log has more.

        Raises BusError, and what ``deliver`` raises.
        """
        if records.log_id != self.cursor.log_id:
            was_read = bool(self.cursor.log_id)
            self._turn_to(records)
            if was_read:
                return True  # it was asked for what follows on another log
        at = self.cursor
        if records.head < at.log_sequence:
            first = min(records.head + 1, self._taken_before[0]) if self._taken_before else records.head + 1
            self._taken_before = range(first, at.log_sequence + 1)
            raise BusError(
                f"log {records.log_id} of unit {self.unit!r} ends at {records.head} and was read to "
                f"{at.log_sequence}: was it restored from a copy? Begin a new one: "
                f"noctule-gateway repair DATA --unit {self.unit}; if the log is right, reset what read it: "
                f"noctule-mapper repair DATA --site SITE --unit {self.unit}"
            )
        self._turns = 0
        self._count_taken_before()
        sifted = sift(records, self.unit, at.log_sequence)
        if sifted.sound or sifted.refused:
            self._commit(sifted.sound, sifted.refused, records.gaps)
            self._pass_over_refused(records.log_id, sifted.refused, records.gaps)
        self._pass_over_gaps(records)
        if self.cursor is at and records.head > at.log_sequence:
            self._pass_over(records)
        self.strangers.compare(records, sifted.sound, self.cursor.log_sequence)
        return self.cursor.log_sequence < records.head

    def _turn_to(self, records: LogRecords) -> None:
        """Read another log of this unit, from its tail if it is new.

        Raises BusError where each reply is of another log, so that the next question waits.
        """
        self._turns += 1
        self._taken_before = range(0)
        self.strangers.forget()
        if self.cursor.log_id:
            _log.warning("unit %s has log %s instead of %s", self.unit, records.log_id, self.cursor.log_id)
            self._left[self.cursor.log_id] = self.cursor
        at_tail = self._at(records.log_id, max(records.tail, 1) - 1)
        self.cursor = self._left.pop(records.log_id, at_tail)
        if len(self._left) > MAX_LOGS_LEFT:
            del self._left[next(iter(self._left))]
        if self._turns > 1:
            raise BusError(f"unit {self.unit!r} answers with one log and then with another: do two gateways serve it?")

    def _count_taken_before(self) -> None:
        """The log has got as far again as it was read when it went back. What it took meanwhile was never read."""
        taken, self._taken_before = self._taken_before, range(0)
        if taken:
            self._counts["lost"] += len(taken)
            _log.error(
                "unit %s: sweeps %d to %d of its log were not read: others were delivered with their sequences before",
                self.unit,
                taken[0],
                taken[-1],
            )

    def _pass_over(self, records: LogRecords) -> None:
        """All that was still to be read has been removed."""
        if self.cursor.log_sequence < records.tail <= records.head:
            raise BusError(
                f"the log of unit {self.unit!r} says that it holds {records.tail} to {records.head} and sends nothing"
            )
        self._count_lost(self.cursor.log_sequence, records.head + 1)
        self.cursor = self._at(records.log_id, records.head)

    def _pass_over_gaps(self, records: LogRecords) -> None:
        """Go on behind the gaps that follow on the cursor: nothing will ever come at their sequences."""
        for gap in records.gaps:
            last = min(gap.last, records.head)
            if gap.first <= self.cursor.log_sequence + 1 <= last:
                self._count_lost(self.cursor.log_sequence, last + 1, gaps=records.gaps)
                self.cursor = self._at(records.log_id, last)

    def _pass_over_refused(self, log_id: str, refused: Mapping[int, str], gaps: Sequence[LogGap]) -> None:
        """Go on behind records that no reader takes, for they would come again for ever."""
        if not refused:
            return
        first, last = min(refused), max(refused)
        if last > self.cursor.log_sequence:
            self._count_lost(self.cursor.log_sequence, last, refused, gaps)
            self.cursor = self._at(log_id, last)
        self._counts["refused"] += len(refused)
        _log.error(
            "unit %s: %d records of its log are refused and passed over, the first is %d: %s",
            self.unit,
            len(refused),
            first,
            refused[first],
        )

    def _commit(self, sweeps: Sequence[Sweep], refused: Collection[int] = (), gaps: Sequence[LogGap] = ()) -> None:
        """Deliver ``sweeps``, in order and all after the cursor, and move the cursor to the last."""
        if not sweeps:
            return
        self._deliver(sweeps)
        before = self.cursor.log_sequence
        for sweep in sweeps:
            self._count_lost(before, sweep.log_sequence, refused, gaps)
            before = sweep.log_sequence
        last = sweeps[-1]
        self.cursor = self._at(last.log_id, before)
        if last.HasField("start"):
            self.cursor.time.CopyFrom(last.start)
        self._counts["delivered"] += len(sweeps)

    def _at(self, log_id: str, log_sequence: int) -> Cursor:
        return Cursor(unit=self.unit, log_id=log_id, log_sequence=log_sequence)

    def _count_lost(self, before: int, after: int, refused: Collection[int] = (), gaps: Sequence[LogGap] = ()) -> None:
        """What lies between two sequences was removed, except what was ``refused`` or is stated as a gap."""
        lost = after - before - 1 - sum(before < sequence < after for sequence in refused)
        for gap in gaps:
            inside = max(min(gap.last, after - 1) - max(gap.first, before + 1) + 1, 0)
            lost -= inside
            if inside and gap.damaged:
                self._counts["damaged"] += inside
                _log.error(
                    "unit %s: sweeps %d to %d of its log are lost: %s", self.unit, gap.first, gap.last, gap.reason
                )
        if lost > 0:
            self._counts["lost"] += lost
            _log.error(
                "unit %s: sweeps %d to %d were removed from its log unread: let the log keep more",
                self.unit,
                before + 1,
                after - 1,
            )
