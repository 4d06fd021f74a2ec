"""Whether only what is heard in one arc has changed: a post that has come near, a door that has opened, or was closed.

Such a thing changes what a unit hears over an arc, and nothing beside it. A unit that was moved hears little as it did,
and one whose bearings are off hears its past at other bearings. So what such a fault gains over the past is compared
with what an arc gains in which any range may be heard.
"""

import math
from collections.abc import Sequence
from itertools import accumulate

from noctule_gateway.health import likelihood
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

_WIDEST_RAD = math.radians(150.0)  # of what is 80 cm wide and 30 cm away: 106 degrees, and the beam's 20 at each end


def elsewhere_nats(sweep: Readings, past: Past) -> list[float]:
    """By bearing, how much likelier the reading is in another place that answers as often than under the past.

    That a bearing is silent as before tells nothing: the next ones are too, here as anywhere.
    """
    nats = [likelihood.elsewhere_nats(past, n, range_m) for n, range_m in enumerate(sweep.range_m)]
    return [max(0.0, each) if math.isnan(range_m) else each for each, range_m in zip(nats, sweep.range_m, strict=True)]


def arc_nats(sweeps: Sequence[Readings], past: Past) -> float:
    """By how many nats the likeliest arc, changed from one of ``sweeps`` on, explains them better than the past; 0 or
    more.
    """
    by_bearing, best = [0.0] * len(past.bearing_rad), 0.0
    for sweep in reversed(sweeps):
        by_bearing = [sum(both) for both in zip(by_bearing, elsewhere_nats(sweep, past), strict=True)]
        best = max(best, _likeliest(by_bearing, past.bearing_rad))
    return best


def _likeliest(nats: Sequence[float], bearing_rad: Sequence[float]) -> float:
    """The largest sum of ``nats`` over neighbouring bearings that span at most _WIDEST_RAD; 0 if none is positive."""
    sums, first, best = list(accumulate(nats, initial=0.0)), 0, 0.0
    for last, end_rad in enumerate(bearing_rad):
        while end_rad - bearing_rad[first] > _WIDEST_RAD:
            first += 1
        best = max(best, sums[last + 1] - min(sums[first : last + 1]))
    return best
