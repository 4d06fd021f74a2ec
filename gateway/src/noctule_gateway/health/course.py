"""How the last sweeps fit the past if the motor loses steps: the angle by which a bearing is off grows against the
sense of turning, from each sweep into the next.
"""

import math
from collections.abc import Sequence

from noctule_gateway.health.alignment import BEGIN_NATS, FIT_OF, Aligned, last_fit
from noctule_gateway.health.offsets import Table

_WELL = -1  # before the first step is lost
_MOST_SLIPPED = 30  # half steps between bearings
_RESCALED_EVERY = 16  # readings: each changes the likelihood by e^7 at the most
_STEP_NATS, _STAY_NATS = 1.9, 0.16  # a motor that loses 1 in 100 moves by half a bearing step at 15 % of the bearings


def slipped(tables: Sequence[Table], one: Aligned, least_gain: float) -> Aligned | None:
    """The gain is the sum over all such courses, ``off`` and ``fit`` are those of the likeliest. None where the gain is
    less than ``least_gain``. ``one`` is the likeliest single angle: where a unit turned by it looks beside its past,
    all courses gain what that gains, since there one coincidence, at each bearing and in each sweep, looks like many.
    """
    none = tables[0].none
    first, turned_at = max(0, none - _MOST_SLIPPED), none + one.off[0]
    chosen = slice(first, none + _MOST_SLIPPED + 1)
    rows = []
    for each, table in enumerate(tables):
        for number, row in enumerate(table.rows):
            beside = each >= one.since and not table.seen(number, turned_at)
            gained = [(row[turned_at] if beside else nats) - row[none] for nats in row[chosen]]
            rows.append((table.forward, gained))
    gain = _all_courses(rows, none - first)
    if gain < least_gain:
        return None
    path = [first + at for at in _course(rows, none - first)]
    last = path[-sum(len(table.rows) for table in tables[-FIT_OF:]) :]
    share = sum(at != none for at in last) / len(last)
    since = next((n for n, at in enumerate(path) if at != none), len(path)) // len(tables[0].rows)
    fit = last_fit(tables, path, [turned_at] * len(path))
    return Aligned((min(path) - none, max(path) - none), gain, since, fit, share)


def _all_courses(rows: list[tuple[bool, list[float]]], none: int) -> float:
    """Log of the likelihood of all courses (forward algorithm), over that of none."""
    step, width, scaled = math.exp(-_STEP_NATS), len(rows[0][1]), -BEGIN_NATS
    here = [1.0 / width] * width  # each times e^scaled
    for number, (forward, nats) in enumerate(rows):
        scaled -= _STAY_NATS
        here[none] += math.exp(-BEGIN_NATS - scaled)
        if forward:
            for at in range(width - 2, -1, -1):
                here[at] += step * here[at + 1]
        else:
            for at in range(1, width):
                here[at] += step * here[at - 1]
        here = [each * math.exp(more) for each, more in zip(here, nats, strict=True)]
        if number % _RESCALED_EVERY == 0:
            most = max(here)
            scaled += math.log(most)
            here = [each / most for each in here]
    return scaled + math.log(sum(here))


def _course(rows: list[tuple[bool, list[float]]], none: int) -> list[int]:
    """The likeliest course, by reading (Viterbi)."""
    width = len(rows[0][1])
    best = [-BEGIN_NATS - math.log(width)] * width
    came_from: list[list[int]] = []
    for forward, nats in rows:
        origin = list(range(width))
        reached = [each - _STAY_NATS for each in best]
        if reached[none] < -BEGIN_NATS:
            reached[none], origin[none] = -BEGIN_NATS, _WELL
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
