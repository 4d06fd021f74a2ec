"""Whether only what is heard in one arc has changed: a post that has come near, a door that has opened, or was closed.

Such a thing changes what a unit hears over an arc, and nothing beside it. A unit that was moved hears little as it did,
and one whose bearings are off hears its past at other bearings. So what such a fault gains over the past is compared
with what an arc gains in which any range may be heard. And a unit that still hears, beside that arc, the reflectors of
before where they were, stands where it stood.
"""

import math
from collections.abc import Sequence
from itertools import accumulate
from statistics import median

from noctule_gateway.health import likelihood
from noctule_gateway.health.marks import ALIKE_M, reflectors_of
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings

ARC_FREEDOM = 9.0  # nats: which of 1,800 arcs, from which of four sweeps on
_WIDEST_RAD = math.radians(150.0)  # of what is 80 cm wide and 30 cm away: 106 degrees, and the beam's 20 at each end
_AGAIN_M, _AGAIN_SHARE = 0.005, 0.002  # their median, in air that is 1 kelvin warmer or colder


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
        best = max(best, _likeliest(by_bearing, past.bearing_rad)[0])
    return best


def repeated_nats(sweeps: Sequence[Readings], past: Past) -> float:
    """By how many nats a change that is heard again in each later sweep explains them better than the past; 0 or more.
    The change is in the likeliest arc or everywhere. Slips are held against this: they change in each sweep.
    """
    best = 0.0
    for first in range(len(sweeps)):
        by_bearing = elsewhere_nats(sweeps[first], past)
        for number, sweep in enumerate(sweeps[first + 1 :], first + 1):
            there = Past(past.bearing_rad, [before.range_m for before in sweeps[first:number]])
            for n, range_m in enumerate(sweep.range_m):
                again, still = (likelihood.likelihood(which, n, range_m) for which in (there, past))
                by_bearing[n] += math.log(again / still)
        best = max(best, sum(by_bearing), _likeliest(by_bearing, past.bearing_rad)[0] - ARC_FREEDOM)
    return best


def stands(sweeps: Sequence[Readings], past: Past) -> bool:
    """Whether a third of the reflectors are heard again in ``sweeps``, beside the likeliest arc and at their ranges:
    what opens, or comes near, changes two where it leaves one. In another place each is by chance once in 500: 0.4 of
    the bearings answer, 20 of 4000 mm are as near. Each counts once, however many bearings hear it: one coincidence
    makes all of them fit.
    """
    by_bearing = [sum(each) for each in zip(*(elsewhere_nats(sweep, past) for sweep in sweeps), strict=True)]
    _, first, last = _likeliest(by_bearing, past.bearing_rad)
    again = changed = 0
    for run in reflectors_of(past):
        if (run[0] > last or run[-1] < first) and _hears_again(run, sweeps, past):
            again += 1
        elif len(run) > 1:  # a corner that one bearing hears is heard beside it now and then
            changed += 1
    return again > 0 and 2 * again >= changed


def _hears_again(run: Sequence[int], sweeps: Sequence[Readings], past: Past) -> bool:
    off_m = [sweep.range_m[n] - past.median_m[n] for sweep in sweeps for n in run]
    near_m = [one_m for one_m in off_m if abs(one_m) <= ALIKE_M]
    if 2 * len(near_m) < len(sweeps) * sum(past.heard_share[n] for n in run):
        return False
    return abs(median(near_m)) <= _AGAIN_M + _AGAIN_SHARE * past.median_m[run[0]]


def _likeliest(nats: Sequence[float], bearing_rad: Sequence[float]) -> tuple[float, int, int]:
    """The largest sum of ``nats`` over neighbouring bearings that span at most _WIDEST_RAD, and the first and last of
    these; 0 and no bearings if none is positive.
    """
    sums, first, best = list(accumulate(nats, initial=0.0)), 0, (0.0, 0, -1)
    for last, end_rad in enumerate(bearing_rad):
        while end_rad - bearing_rad[first] > _WIDEST_RAD:
            first += 1
        begin = min(range(first, last + 1), key=lambda n: (sums[n], -n))
        best = max(best, (sums[last + 1] - sums[begin], begin, last), key=lambda arc: arc[0])
    return best
