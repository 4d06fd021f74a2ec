"""How much may be written to an audit log, so that a flood can't wash out what was written before.

A budget fills up at a steady rate. A line that finds all its budgets empty is only counted: one line says how many came
of what kind.
"""

import json
import logging
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from noctule_gateway.audit.lines import Facts

DAY_S = 86_400.0
KEPT_AT_LEAST_S = 30 * DAY_S
SUM_UP_EVERY_S = 600.0
RESERVE_BYTES = (
    1000  # a budget pays for no line with less: else a flood's short lines would leave nothing for long ones
)
CALLERS = 14  # signed ones that have a budget each

_SHARES = CALLERS + 2  # of half of all: the callers', one of all others, and that of _GRAVE; the other half is common
_GRAVE = ("update", "calibrate", "store")  # rare, and they change a unit for good
_BESIDE_FACTS_BYTES = 120  # number, time and hash of a line
_KIND = ("event", "unit", "command", "who")
_MOST_KINDS = 5  # named in a sum; so many sums a day stay below every budget
_LONGEST = 64  # characters of a name in a sum; what a stranger has made up may be longer

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Keeping:
    """What an audit log keeps: ``records``, in ``name``. ``family`` begins its files' names.

    All together they hold ``max_bytes``. ``burst_bytes`` may come at once and ``bytes_per_day`` for ever, so that
    KEPT_AT_LEAST_S pass before a file has to go.
    """

    family: str
    name: str
    records: str
    max_bytes: int
    burst_bytes: int
    bytes_per_day: int
    max_file_bytes: int = 4_000_000


COMMANDS = Keeping(
    "audit", "audit log", "commands", max_bytes=256_000_000, burst_bytes=16_000_000, bytes_per_day=7_500_000
)
REFUSALS = Keeping(
    "refused", "log of refusals", "refusals", max_bytes=48_000_000, burst_bytes=2_000_000, bytes_per_day=1_300_000
)


class Budget:
    """Bytes that may be written; times are seconds of a clock that never goes back."""

    def __init__(self, burst_bytes: float, bytes_per_s: float, now_s: float) -> None:
        self._burst_bytes, self._bytes_per_s = burst_bytes, bytes_per_s
        self._left_bytes, self._at_s = burst_bytes, now_s

    def left_bytes(self, now_s: float) -> float:
        """What may be written now; less than nothing after a line that was longer than what was left."""
        came_bytes = (now_s - self._at_s) * self._bytes_per_s
        self._left_bytes, self._at_s = min(self._left_bytes + came_bytes, self._burst_bytes), now_s
        return self._left_bytes

    def is_full(self, now_s: float) -> bool:
        """Whether nothing was written for long."""
        return self.left_bytes(now_s) >= self._burst_bytes

    def charge(self, size_bytes: int, now_s: float) -> None:
        """A line of this size is written; later ones wait longer for it."""
        self._left_bytes = self.left_bytes(now_s) - size_bytes


class Allowance:
    """Says of each line of a log whether it is written or only counted. To be called by one thread at a time.

    A line is paid from the common budget, then from its caller's own: no caller can use up what others have. Of the
    signed callers, CALLERS have one each; all others share one, because a client can make up any name. The grave
    commands have one more. ``counted`` counts what is not written.
    """

    def __init__(self, keeping: Keeping, now_s: Callable[[], float]) -> None:
        self._keeping, self._now_s = keeping, now_s
        self._common, self._others, self._grave = self._budget(2), self._budget(2 * _SHARES), self._budget(2 * _SHARES)
        self._own: dict[str, Budget] = {}
        self._sum: Sum | None = None
        self.counted = 0

    def admit(self, line: Facts, payer: Budget | None = None) -> Budget | None:
        """The budget that pays for ``line``; None where it is only counted.

        An outcome names the ``payer`` of what it is the outcome of, and is written in any case.
        """
        now_s = self._now_s()
        payer = payer or next((each for each in self._budgets(line) if each.left_bytes(now_s) >= RESERVE_BYTES), None)
        if payer is None:
            self._count(line)
        else:
            payer.charge(_size(line), now_s)
        return payer

    def take_sum(self, by_s: float) -> Facts | None:
        """The line that tells of what was only counted, if it is due ``by_s``."""
        if self._sum is None or self._sum.due_s > by_s:
            return None
        line, self._sum = self._sum.facts(), None
        self._common.charge(_size(line), self._now_s())
        return line

    def _budget(self, part: int) -> Budget:
        """One ``part``-th of all."""
        return Budget(self._keeping.burst_bytes / part, self._keeping.bytes_per_day / part / DAY_S, self._now_s())

    def _budgets(self, line: Facts) -> list[Budget]:
        """What may pay for a line, in that order."""
        own = self._caller(line["who"]) if line.get("signed") else self._others
        return [self._common, own, *([self._grave] if line.get("command") in _GRAVE else [])]

    def _caller(self, name: str) -> Budget:
        """The caller's own budget: a new one, or that of a caller who has long been silent, or the others'."""
        if name not in self._own:
            if len(self._own) < CALLERS:
                self._own[name] = self._budget(2 * _SHARES)
            elif silent := next((each for each, budget in self._own.items() if budget.is_full(self._now_s())), None):
                self._own[name] = self._own.pop(silent)
        return self._own.get(name, self._others)

    def _count(self, line: Facts) -> None:
        if self._sum is None:
            self._sum = Sum(self._now_s() + SUM_UP_EVERY_S)
            _log.warning(
                "more %s come than the %s may hold: some are only counted for %g min",
                self._keeping.records,
                self._keeping.name,
                SUM_UP_EVERY_S / 60,
            )
        self._sum.add(line)
        self.counted += 1


@dataclass
class Sum:
    """Lines that are not written one by one. ``due_s`` is when the sum is to be written."""

    due_s: float
    kinds: Counter[tuple[str, ...]] = field(default_factory=Counter)
    others: int = 0

    def add(self, line: Facts) -> None:
        """One more. The first kinds are counted each, all others together."""
        kind = tuple(_shortened(str(line.get(name, ""))) for name in _KIND)
        if kind in self.kinds or len(self.kinds) < _MOST_KINDS:
            self.kinds[kind] += 1
        else:
            self.others += 1

    def facts(self) -> Facts:
        """The line that tells of them."""
        kinds = [
            {name: value for name, value in zip(_KIND, kind, strict=True) if value} | {"count": count}
            for kind, count in self.kinds.most_common()
        ]
        others = {"others": self.others} if self.others else {}
        return {"event": "summed up", "count": self.kinds.total() + self.others, "kinds": kinds} | others


def _shortened(name: str) -> str:
    """As printable ASCII: JSON makes up to twelve bytes of any other character."""
    return name.encode("unicode_escape")[:_LONGEST].decode()


def _size(line: Facts) -> int:
    return len(json.dumps(line, separators=(",", ":"))) + _BESIDE_FACTS_BYTES
