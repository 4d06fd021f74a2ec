"""How a sweep fits the past if the bearings are off: by the same angle throughout, or by one that changes within it.

The likelihood of a reading that looks where the past looked at bearing j: with the share h of the past at j that was
heard, a range r has h (0.85 c / ((m + 1) 5 cm) + 0.15 / 4 m) where c of the m ranges heard at j lie within 2.5 cm of
r, and silence has 1 - h. So a wrong reading costs 7 nats at the most, whatever its range, and a door that opens
changes the likelihood of all offsets alike.

The angle that changes is found by dynamic programming over the offsets (Viterbi) in the order in which the unit
turned; each step of the offset by one bearing costs 4 nats.
"""

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past

_WINDOW_M = 0.025
_OUTLIERS = 0.15
_REACH_M = 4.0
_STEP_NATS = 4.0
_MOST_RAD = math.radians(100.0)
_LEAST_READINGS = 20  # of a plan, and common to sweep and past: too few edges tell nothing
_EVEN_RAD = math.radians(0.5)


@dataclass(frozen=True)
class Alignment:
    """Offsets are in bearing steps of ``step_rad``: at a reading's bearing the unit looks where it looked, in the past,
    at the bearing plus the offset. Likelihoods are in nats, those of ``..._fit`` a reading.
    """

    step_rad: float
    offset: int  # the likeliest that holds throughout
    gain: float  # of it over none
    fit: float
    path: tuple[int, ...]  # the likeliest that may change, by rising bearing
    path_gain: float  # of it over ``offset``
    path_fit: float

    @property
    def turned_rad(self) -> float:
        """By how much the unit is turned anticlockwise."""
        return self.offset * self.step_rad


def stay_fit(look: Look, past: Past) -> float:
    """Mean log likelihood of a reading if nothing has changed."""
    return sum(_nats(past, n, range_m) for n, range_m in enumerate(look.range_m)) / len(look.range_m)


def align(look: Look, past: Past) -> Alignment | None:
    """None where the plan is too coarse, or its bearings are not evenly spaced."""
    count = len(look.range_m)
    steps = [b - a for a, b in zip(look.bearing_rad, look.bearing_rad[1:], strict=False)]
    if count < _LEAST_READINGS or max(steps) - min(steps) > _EVEN_RAD or max(steps) <= 0:
        return None
    step_rad = (look.bearing_rad[-1] - look.bearing_rad[0]) / (count - 1)
    most = min(int(_MOST_RAD / step_rad), count - _LEAST_READINGS)
    offsets = range(-most, most + 1)
    table = [[_nats(past, n + k, range_m) for k in offsets] for n, range_m in enumerate(look.range_m)]
    sums = [sum(row[at] for row in table) for at in range(len(offsets))]
    best = max(range(len(offsets)), key=lambda at: sums[at])
    path, path_nats = _path(table if look.forward else table[::-1])
    path = path if look.forward else path[::-1]
    return Alignment(
        step_rad=step_rad,
        offset=offsets[best],
        gain=sums[best] - sums[most],
        fit=_fit_within(table, [best] * count, most),
        path=tuple(offsets[at] for at in path),
        path_gain=path_nats - sums[best],
        path_fit=_fit_within(table, path, most),
    )


def _fit_within(table: list[list[float]], at: list[int], most: int) -> float:
    """Mean of the readings that the past has something to say of."""
    count = len(table)
    within = [table[n][each] for n, each in enumerate(at) if 0 <= n + each - most < count]
    return sum(within) / len(within)


def _path(table: list[list[float]]) -> tuple[list[int], float]:
    """The best column of each row, and the nats of them all."""
    width = len(table[0])
    best, came_from = list(table[0]), []
    for row in table[1:]:
        origin = list(range(width))
        reached = list(best)
        for order in (range(1, width), range(width - 2, -1, -1)):
            back = -1 if order.step > 0 else 1
            for at in order:
                stepped = reached[at + back] - _STEP_NATS
                if stepped > reached[at]:
                    reached[at], origin[at] = stepped, origin[at + back]
        came_from.append(origin)
        best = [nats + more for nats, more in zip(reached, row, strict=True)]
    at = max(range(width), key=lambda each: best[each])
    path, nats = [at], best[at]
    for origin in reversed(came_from):
        path.append(origin[path[-1]])
    return path[::-1], nats


def _nats(past: Past, bearing: int, range_m: float) -> float:
    """Log likelihood of a range, or of silence (NaN), at a bearing of the past; of any, where it has none such."""
    if not 0 <= bearing < len(past.heard):
        return -math.log(2) if math.isnan(range_m) else math.log(0.5 / _REACH_M)
    share = past.heard_share[bearing]
    if math.isnan(range_m):
        return math.log1p(-share)
    known = past.heard[bearing]
    density = _OUTLIERS / _REACH_M
    if known:
        near = bisect_right(known, range_m + _WINDOW_M) - bisect_left(known, range_m - _WINDOW_M)
        density += (1 - _OUTLIERS) * near / ((len(known) + 1) * 2 * _WINDOW_M)
    return math.log(share * density)
