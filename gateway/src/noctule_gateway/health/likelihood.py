"""How likely a reading is under the past.

With the share h of the past at a bearing that was heard, a range r has h (0.85 c / ((m + 1) 5 cm) + 0.15 / 4 m) where c
of the m ranges heard there lie within 2.5 cm of r, and silence has 1 - h. So a wrong reading costs 7 nats at the most,
whatever its range, and a door that opens changes the likelihood at all offsets of the bearings alike.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence

from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

Longer = Callable[[float, float], float]  # by direction and range, in metres

_WINDOW_M = 0.025
_OUTLIERS = 0.15
_REACH_M = 4.0
_UNSEEN_SHARE = 0.5  # that answers where the past never looked


def stay_fit(sweep: Readings, past: Past) -> float:
    """Mean log likelihood of a reading if nothing has changed."""
    return sum(math.log(likelihood(past, n, range_m)) for n, range_m in enumerate(sweep.range_m)) / len(sweep.range_m)


def usual_fit(past: Past) -> float:
    """Mean log likelihood of the past's own readings, without echoes that are alone."""
    nats = [
        math.log(likelihood(past, n, range_m))
        for row in past.rows
        for n, (range_m, alone) in enumerate(zip(row, alone_in(row), strict=True))
        if not alone
    ]
    return sum(nats) / len(nats) if nats else 0.0  # of a past of nothing else no sweep fits as well as usual


def alone_in(range_m: Sequence[float]) -> list[bool]:
    """Which readings of a sweep are echoes that neither of the two neighbours on either side hears, to within 2.5 cm:
    most of these are false ones.
    """

    def is_alone(n: int) -> bool:
        near_m = (*range_m[max(0, n - 2) : n], *range_m[n + 1 : n + 3])
        return not math.isnan(range_m[n]) and not any(abs(range_m[n] - other_m) <= _WINDOW_M for other_m in near_m)

    return [is_alone(n) for n in range(len(range_m))]


def shifted_nats(sweep: Readings, past: Past, longer: Longer) -> float:
    """Log likelihood of the sweep if the past's ranges have become ``longer``. Where the past heard nothing, there is
    nothing to become so.
    """
    longer_m = (
        0.0 if math.isnan(median_m) else longer(bearing_rad, median_m)
        for bearing_rad, median_m in zip(sweep.bearing_rad, past.median_m, strict=True)
    )
    return sum(
        math.log(likelihood(past, n, range_m - by_m))
        for n, (range_m, by_m) in enumerate(zip(sweep.range_m, longer_m, strict=True))
    )


def likelihood(past: Past, bearing: int, range_m: float) -> float:
    """Of a range, or of silence (NaN), at a bearing of the past; of any, where it has none such."""
    if not 0 <= bearing < len(past.heard):
        return likelihood_anywhere(_UNSEEN_SHARE, range_m)
    share = past.heard_share[bearing]
    if math.isnan(range_m):
        return 1 - share
    known = past.heard[bearing]
    density = _OUTLIERS / _REACH_M
    if known:
        near = bisect_right(known, range_m + _WINDOW_M) - bisect_left(known, range_m - _WINDOW_M)
        density += (1 - _OUTLIERS) * near / ((len(known) + 1) * 2 * _WINDOW_M)
    return share * density


def likelihood_anywhere(share: float, range_m: float) -> float:
    """Of a range, or of silence (NaN), where that share of readings is heard, at any range."""
    return 1 - share if math.isnan(range_m) else share / _REACH_M


def elsewhere_nats(past: Past, n: int, range_m: float) -> float:
    """How much likelier reading ``n`` is in another place that answers as often than under the past."""
    return math.log(likelihood_anywhere(past.mean_heard_share, range_m) / likelihood(past, n, range_m))
