"""How much may be written to an audit log, so that a flood can't wash out what was written before.

A budget fills up at a steady rate. What finds it empty is not written line by line: one line says how many of what
kind.
"""

from collections import Counter
from dataclasses import dataclass, field

from noctule_gateway.audit.lines import Facts

DAY_S = 86_400.0
KEPT_AT_LEAST_S = 30 * DAY_S
SUM_UP_EVERY_S = 600.0

_KIND = ("event", "unit", "command", "who")
_MOST_KINDS = 5  # named in a sum; so many sums a day stay below every budget
_LONGEST = 64  # characters of a name in a sum; what a stranger has made up may be longer


@dataclass(frozen=True)
class Keeping:
    """What an audit log keeps. ``family`` begins its files' names.

    All together they hold ``max_bytes``. ``burst_bytes`` may come at once and ``bytes_per_day`` for ever, so that
    KEPT_AT_LEAST_S pass before a file has to go.
    """

    family: str
    max_bytes: int
    burst_bytes: int
    bytes_per_day: int
    max_file_bytes: int = 4_000_000


COMMANDS = Keeping("audit", max_bytes=256_000_000, burst_bytes=16_000_000, bytes_per_day=7_500_000)
REFUSALS = Keeping("refused", max_bytes=48_000_000, burst_bytes=2_000_000, bytes_per_day=1_300_000)


class Allowance:
    """The budget of one log; times are seconds of a clock that never goes back."""

    def __init__(self, keeping: Keeping, now_s: float) -> None:
        self._burst_bytes, self._bytes_per_s = keeping.burst_bytes, keeping.bytes_per_day / DAY_S
        self._left_bytes, self._at_s = float(keeping.burst_bytes), now_s

    def takes(self, size_bytes: int, now_s: float) -> bool:
        """Whether a line of this size may be written; it is charged then."""
        if self._fill(now_s) < size_bytes:
            return False
        self.charge(size_bytes, now_s)
        return True

    def charge(self, size_bytes: int, now_s: float) -> None:
        """A line of this size is written in any case; later ones wait longer for it."""
        self._left_bytes = self._fill(now_s) - size_bytes

    def _fill(self, now_s: float) -> float:
        came_bytes = (now_s - self._at_s) * self._bytes_per_s
        self._left_bytes, self._at_s = min(self._left_bytes + came_bytes, self._burst_bytes), now_s
        return self._left_bytes


@dataclass
class Sum:
    """Lines that are not written one by one. ``due_s`` is when the sum is to be written."""

    due_s: float
    kinds: Counter[tuple[str, ...]] = field(default_factory=Counter)
    count: int = 0

    def add(self, facts: Facts) -> None:
        """One more. The first kinds are counted each, all others together."""
        self.count += 1
        kind = tuple(str(facts.get(name, ""))[:_LONGEST] for name in _KIND)
        if kind in self.kinds or len(self.kinds) < _MOST_KINDS:
            self.kinds[kind] += 1

    def facts(self) -> Facts:
        """The line that tells of them."""
        kinds = [
            {name: value for name, value in zip(_KIND, kind, strict=True) if value} | {"count": count}
            for kind, count in self.kinds.most_common()
        ]
        return {"event": "summed up", "count": self.count, "kinds": kinds}
