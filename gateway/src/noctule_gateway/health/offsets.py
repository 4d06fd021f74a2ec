"""How likely each reading of a sweep is if its bearing is off, by offset: half steps between two bearings of the plan.

Between two bearings of the past the likelihood is the mean of both.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

from noctule_gateway.health.likelihood import alone_in, likelihood
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

_MOST_RAD = math.radians(100.0)
_LEAST_READINGS = 20  # of a plan, and common to sweep and past: too few edges tell nothing
_EVEN_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Table:
    """One sweep: nats by reading in the order of time and by offset, ``none`` of these being no offset. ``alone`` as
    in likelihood.alone_in().
    """

    rows: list[list[float]]
    alone: list[bool]
    none: int
    step_rad: float
    forward: bool

    def seen(self, number: int, at: int) -> bool:
        """The past looked where the reading looks at that offset."""
        bearing = number if self.forward else len(self.rows) - 1 - number
        return 0 <= bearing + (at - self.none) / 2 <= len(self.rows) - 1

    @cached_property
    def gains(self) -> tuple[list[float], list[float]]:
        """By offset, over none: the nats of all readings, and the most that those from any one on have."""
        total = [0.0] * len(self.rows[0])
        best = total
        for row in reversed(self.rows):
            none = row[self.none]
            total = [each + nats - none for each, nats in zip(total, row, strict=True)]
            best = list(map(max, best, total))
        return total, best


def table_of(sweep: Readings, past: Past) -> Table | None:
    """None where the plan is too coarse, or its bearings are not evenly spaced."""
    count = len(sweep.range_m)
    steps = [b - a for a, b in zip(sweep.bearing_rad, sweep.bearing_rad[1:], strict=False)]
    if count < _LEAST_READINGS or max(steps) - min(steps) > _EVEN_RAD or max(steps) <= 0:
        return None
    step_rad = (sweep.bearing_rad[-1] - sweep.bearing_rad[0]) / (count - 1)
    most = min(int(_MOST_RAD / step_rad), count - _LEAST_READINGS)
    rows = []
    for n, range_m in enumerate(sweep.range_m):
        whole = [likelihood(past, n + k, range_m) for k in range(-most, most + 1)]
        halves = [math.log((a + b) / 2) for a, b in pairwise(whole)]
        row = [math.log(each) for each in whole]
        rows.append([row[at // 2] if at % 2 == 0 else halves[at // 2] for at in range(4 * most + 1)])
    alone, back = alone_in(sweep.range_m), slice(None, None, 1 if sweep.forward else -1)
    return Table(rows[back], alone[back], 2 * most, step_rad, sweep.forward)


def fit_of(tables: Sequence[Table], path: Sequence[int], compared: Sequence[int]) -> float:
    """Mean nats of a reading at the offsets ``path``, by reading of all tables; of those readings for which the past
    looked where they look at ``path`` and at the offsets ``compared``, and that are no echoes alone.
    """
    readings = [(table, number, row) for table in tables for number, row in enumerate(table.rows)]
    seen = [
        row[at]
        for (table, number, row), at, other in zip(readings, path, compared, strict=True)
        if not table.alone[number] and table.seen(number, at) and table.seen(number, other)
    ]
    return sum(seen) / len(seen) if seen else -math.inf
