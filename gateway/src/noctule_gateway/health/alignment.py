"""How the last sweeps fit the past if their bearings are off: by one angle, by one for each sense of turning (play),
or by one that grows against the sense of turning (a motor that loses steps).

The likelihood of a reading that looks where the past looked at bearing j: with the share h of the past at j that was
heard, a range r has h (0.85 c / ((m + 1) 5 cm) + 0.15 / 4 m) where c of the m ranges heard at j lie within 2.5 cm of
r, and silence has 1 - h. So a wrong reading costs 7 nats at the most, whatever its range, and a door that opens
changes the likelihood of all offsets alike. Between two bearings of the past it is the mean of both likelihoods.

All three are measured over several sweeps together, in nats over what the past alone makes of them, so that they can be
compared with each other. Turned or with play it may be since any reading: before that, none is off.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past

_WINDOW_M = 0.025
_OUTLIERS = 0.15
_REACH_M = 4.0
_UNSEEN = 0.5 / _REACH_M, 0.5  # likelihood of a range, and of silence, where the past never looked
_MOST_RAD = math.radians(100.0)
_FIT_OF = 2  # sweeps
_BEGIN_NATS = 5.5  # of one reading in 250
_WELL = -1  # before the first step is lost
_MOST_SLIPPED = 30  # half steps between bearings
_LEAST_READINGS = 20  # of a plan, and common to sweep and past: too few edges tell nothing
_EVEN_RAD = math.radians(0.5)
_STEP_NATS, _STAY_NATS = 1.9, 0.16  # a motor that loses 1 in 100 moves by half a bearing step at 15 % of the bearings


@dataclass(frozen=True)
class Aligned:
    """The likeliest offset of one kind. ``off`` is in half steps between bearings: at a reading's bearing the unit
    looks where it looked, in the past, at the bearing plus that; where several are meant, the least and the largest.
    """

    off: tuple[int, int]
    gain: float  # nats over none
    since: int  # the sweep within which it began, of those that were asked
    fit: float  # mean nats of a reading of the last two sweeps that the past has something to say of
    share: float = 1.0  # of the last two sweeps' readings that are off

    @property
    def between(self) -> int:
        """From the least to the largest."""
        return self.off[1] - self.off[0]


@dataclass(frozen=True)
class Table:
    """One sweep: nats by reading in the order of time and by offset, ``none`` of these being no offset."""

    rows: list[list[float]]
    none: int
    step_rad: float
    forward: bool

    def seen(self, number: int, at: int) -> bool:
        """The past looked where the reading looks at that offset."""
        bearing = number if self.forward else len(self.rows) - 1 - number
        return 0 <= bearing + (at - self.none) / 2 <= len(self.rows) - 1


def stay_fit(look: Look, past: Past) -> float:
    """Mean log likelihood of a reading if nothing has changed."""
    return sum(math.log(_likelihood(past, n, range_m)) for n, range_m in enumerate(look.range_m)) / len(look.range_m)


def shifted_nats(look: Look, past: Past, longer_m: Sequence[float]) -> float:
    """Log likelihood of the sweep if the range at each bearing has become longer by so much."""
    return sum(
        math.log(_likelihood(past, n, range_m - longer))
        for n, (range_m, longer) in enumerate(zip(look.range_m, longer_m, strict=True))
    )


def table_of(look: Look, past: Past) -> Table | None:
    """None where the plan is too coarse, or its bearings are not evenly spaced."""
    count = len(look.range_m)
    steps = [b - a for a, b in zip(look.bearing_rad, look.bearing_rad[1:], strict=False)]
    if count < _LEAST_READINGS or max(steps) - min(steps) > _EVEN_RAD or max(steps) <= 0:
        return None
    step_rad = (look.bearing_rad[-1] - look.bearing_rad[0]) / (count - 1)
    most = min(int(_MOST_RAD / step_rad), count - _LEAST_READINGS)
    rows = []
    for n, range_m in enumerate(look.range_m):
        whole = [_likelihood(past, n + k, range_m) for k in range(-most, most + 1)]
        halves = [math.log((a + b) / 2) for a, b in pairwise(whole)]
        row = [math.log(each) for each in whole]
        rows.append([row[at // 2] if at % 2 == 0 else halves[at // 2] for at in range(4 * most + 1)])
    return Table(rows if look.forward else rows[::-1], 2 * most, step_rad, look.forward)


def turned(tables: Sequence[Table]) -> Aligned:
    """By one angle."""
    none = tables[0].none
    gains, starts = _since_any_reading(tables)
    # An edge between two bearings leaves the half step open: a motion does as much as half a step.
    at = max((at for at in range(len(gains)) if abs(at - none) != 1), key=lambda at: (gains[at], -abs(at - none)))
    path = [at if number >= starts[at] else none for number, table in enumerate(tables) for _ in table.rows]
    return Aligned((at - none, at - none), gains[at], starts[at], _fit(tables, path))


def with_play(tables: Sequence[Table]) -> Aligned:
    """By one angle for each sense, in whole steps: an edge between two bearings leaves the half step open."""
    none = tables[0].none
    ends, gain, since = {}, 0.0, len(tables)
    for sense in (True, False):
        gains, starts = _since_any_reading(tables, sense)
        ends[sense] = at = max(range(none % 2, len(gains), 2), key=lambda at: (gains[at], -abs(at - none)))
        gain, since = gain + gains[at], min(since, starts[at])
    off = sorted(at - none for at in ends.values())
    path = [ends[table.forward] if number >= since else none for number, table in enumerate(tables) for _ in table.rows]
    return Aligned((off[0], off[1]), gain, since, _fit(tables, path))


def slipped(tables: Sequence[Table], least_gain: float) -> Aligned | None:
    """By an angle that grows against the sense of turning, from each sweep into the next: the gain is the sum over all
    such courses, ``off`` and ``fit`` are those of the likeliest. None where the gain is less than ``least_gain``.
    """
    first = max(0, tables[0].none - _MOST_SLIPPED)
    chosen, none = slice(first, tables[0].none + _MOST_SLIPPED + 1), tables[0].none - first
    rows = [(table.forward, [nats - row[table.none] for nats in row[chosen]]) for table in tables for row in table.rows]
    gain = _all_courses(rows, none)
    if gain < least_gain:
        return None
    path = _course(rows, none)
    off = min(path) - none, max(path) - none
    last = path[-sum(len(table.rows) for table in tables[-_FIT_OF:]) :]
    share = sum(at != none for at in last) / len(last)
    return Aligned(off, gain, 0, _fit(tables, [first + at for at in path]), share)


def _all_courses(rows: list[tuple[bool, list[float]]], none: int) -> float:
    """Log of the likelihood of all courses (forward algorithm), over that of none."""
    step, stay, begin = math.exp(-_STEP_NATS), math.exp(-_STAY_NATS), math.exp(-_BEGIN_NATS)
    width, scaled = len(rows[0][1]), 0.0
    here = [begin / width] * width
    for forward, nats in rows:
        here = [stay * each for each in here]
        here[none] += begin * math.exp(-scaled)
        if forward:
            for at in range(width - 2, -1, -1):
                here[at] += step * here[at + 1]
        else:
            for at in range(1, width):
                here[at] += step * here[at - 1]
        here = [each * math.exp(more) for each, more in zip(here, nats, strict=True)]
        most = max(here)
        scaled += math.log(most)
        here = [each / most for each in here]
    return scaled + math.log(sum(here))


def _course(rows: list[tuple[bool, list[float]]], none: int) -> list[int]:
    """The likeliest course, by reading (Viterbi)."""
    width = len(rows[0][1])
    best = [-_BEGIN_NATS - math.log(width)] * width
    came_from: list[list[int]] = []
    for forward, nats in rows:
        origin = list(range(width))
        reached = [each - _STAY_NATS for each in best]
        if reached[none] < -_BEGIN_NATS:
            reached[none], origin[none] = -_BEGIN_NATS, _WELL
        back = 1 if forward else -1  # from this neighbour: turning forward, the offset falls
        for at in range(width - 2, -1, -1) if forward else range(1, width):
            stepped = reached[at + back] - _STEP_NATS
            if stepped > reached[at]:
                reached[at], origin[at] = stepped, origin[at + back]
        came_from.append(origin)
        best = [each + more for each, more in zip(reached, nats, strict=True)]
    at, path = max(range(width), key=lambda at: best[at]), []
    for origin in reversed(came_from):
        path.append(none if at == _WELL else at)
        at = _WELL if at == _WELL else origin[at]
    return path[::-1]


def _since_any_reading(tables: Sequence[Table], sense: bool | None = None) -> tuple[list[float], list[int]]:
    """By offset the most that it gains from any reading on, and the sweep of that reading; of one sense or both."""
    width = len(tables[0].rows[0])
    sums, starts = [-_BEGIN_NATS] * width, [len(tables)] * width
    for number, table in enumerate(tables):
        if sense not in (None, table.forward):
            continue
        for row in table.rows:
            none = row[table.none]
            for at, nats in enumerate(row):
                if sums[at] > -_BEGIN_NATS:
                    sums[at] += nats - none
                elif nats > none:
                    sums[at], starts[at] = nats - none - _BEGIN_NATS, number
    return [max(0.0, total) for total in sums], starts


def _fit(tables: Sequence[Table], path: Sequence[int]) -> float:
    """Of the last two sweeps."""
    first = len(path) - sum(len(table.rows) for table in tables[-_FIT_OF:])
    within, at = [], iter(path[first:])
    for table in tables[-_FIT_OF:]:
        for number, row in enumerate(table.rows):
            offset = next(at)
            if table.seen(number, offset):
                within.append(row[offset])
    return sum(within) / len(within)


def _likelihood(past: Past, bearing: int, range_m: float) -> float:
    """Of a range, or of silence (NaN), at a bearing of the past; of any, where it has none such."""
    if not 0 <= bearing < len(past.heard):
        return _UNSEEN[math.isnan(range_m)]
    share = past.heard_share[bearing]
    if math.isnan(range_m):
        return 1 - share
    known = past.heard[bearing]
    density = _OUTLIERS / _REACH_M
    if known:
        near = bisect_right(known, range_m + _WINDOW_M) - bisect_left(known, range_m - _WINDOW_M)
        density += (1 - _OUTLIERS) * near / ((len(known) + 1) * 2 * _WINDOW_M)
    return share * density
