"""How the last sweeps fit the past if their bearings are off by one angle, or by one for each sense of turning (play).

All is measured over several sweeps together, in nats over what the past alone makes of them, so that it can be
compared. Turned or with play it may be since any reading: before that, none is off.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from noctule_gateway.health.offsets import Table, fit_of

FIT_OF = 2  # sweeps
BEGIN_NATS = 5.5  # of one reading in 250
_MOST_PLAY_RAD = math.radians(32.0)  # between the senses: 5 to 22 degrees in public scans


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


def turned(tables: Sequence[Table]) -> Aligned:
    """By one angle."""
    none = tables[0].none
    gains, starts = _since_any_reading(tables)
    # An edge between two bearings leaves the half step open: a motion does as much as half a step.
    at = max((at for at in range(len(gains)) if abs(at - none) != 1), key=lambda at: (gains[at], -abs(at - none)))
    path = [at if number >= starts[at] else none for number, table in enumerate(tables) for _ in table.rows]
    return Aligned((at - none, at - none), gains[at], starts[at], last_fit(tables, path, path))


def with_play(tables: Sequence[Table]) -> Aligned:
    """By one angle for each sense, in whole steps: an edge between two bearings leaves the half step open."""
    none, count = tables[0].none, len(tables[0].rows[0])
    ahead, ahead_starts = _since_any_reading(tables, True)
    back, back_starts = _since_any_reading(tables, False)
    # Only to choose: of one sweep alone one of so many angles often gains a little by chance. What is then compared
    # with other explanations is the gain itself.
    choice = math.log(count / 2)

    def likely(ends: tuple[int, int]) -> tuple[float, int]:
        a, b = ends
        return ahead[a] + back[b] - choice * ((a != none) + (b != none)), -abs(a - none) - abs(b - none)

    def aligned(ends: tuple[int, int]) -> Aligned:
        a, b = ends
        since = min(ahead_starts[a], back_starts[b])
        path = [
            (a if table.forward else b) if number >= since else none
            for number, table in enumerate(tables)
            for _ in table.rows
        ]
        off = sorted((a - none, b - none))
        return Aligned((off[0], off[1]), ahead[a] + back[b], since, last_fit(tables, path, path))

    most = 2 * int(_MOST_PLAY_RAD / tables[0].step_rad)
    whole = range(none % 2, count, 2)
    a, b = max(((a, b) for a in whole for b in whole if abs(a - b) <= most), key=likely)
    # An angle that only a sweep's last readings fit by chance: since play began no angle fits better.
    return max(map(aligned, ((a, b), (a, none), (none, b))), key=lambda each: each.fit)


def last_fit(tables: Sequence[Table], path: Sequence[int], compared: Sequence[int]) -> float:
    """Of the last two sweeps: see ``fit_of``."""
    first = len(path) - sum(len(table.rows) for table in tables[-FIT_OF:])
    return fit_of(tables[-FIT_OF:], path[first:], compared[first:])


def _since_any_reading(tables: Sequence[Table], sense: bool | None = None) -> tuple[list[float], list[int]]:
    """By offset the most that it gains from any reading on, and the sweep of that reading; of one sense or both."""
    width = len(tables[0].rows[0])
    gains, starts, later = [0.0] * width, [len(tables)] * width, [-BEGIN_NATS] * width
    for number in reversed(range(len(tables))):
        if sense not in (None, tables[number].forward):
            continue
        total, best = tables[number].gains
        for at, (most, after) in enumerate(zip(best, later, strict=True)):
            if most + after > gains[at]:
                gains[at], starts[at] = most + after, number
        later = [each + after for each, after in zip(total, later, strict=True)]
    return gains, starts
