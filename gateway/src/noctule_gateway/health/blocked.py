"""Something right before the sensor over a wide arc, where it used to hear farther.

Nearer than 20 cm over 50 degrees: a person who walks by does not stay there from one sweep to the next. Of false
echoes, 4 % of the readings and 1 in 20 of them so near, no two neighbours make an arc.
"""

import math

from noctule import messages_pb2 as messages
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_NEAR_M = 0.2
_FARTHER_M = 0.05  # than now, at the least, it was before
_ARC_RAD = math.radians(50.0)
_LEAST_SHARE = 0.6  # of the arc's readings: of twenty 88 % are near, fewer than so many in one sweep of a thousand
_NEW_SHARE = 0.5  # of them, that used to be farther
_LEAST_READINGS = 4
_EVIDENCE = 20.0


def suspicions(sweep: Readings, past: Past | None) -> list[Suspicion]:
    """The widest arc that is blocked; without a past only what blocks nearly all of the sweep."""
    near = [number for number, range_m in enumerate(sweep.range_m) if range_m < _NEAR_M]
    if past is None and len(near) < _LEAST_SHARE * len(sweep.range_m):
        return []
    arc = _widest(near)
    if len(arc) < _LEAST_READINGS or sweep.bearing_rad[arc[-1]] - sweep.bearing_rad[arc[0]] < _ARC_RAD:
        return []
    if past is not None and sum(_nearer(sweep, past, number) for number in arc) < _NEW_SHARE * len(arc):
        return []
    if past is not None and not past.agrees([sweep], range(arc[0], arc[-1] + 1)):
        return []  # all else has changed too: it looks elsewhere
    first, last = (round(math.degrees(sweep.bearing_rad[number])) for number in (arc[0], arc[-1]))
    nearest_m = min(sweep.range_m[number] for number in arc)
    words = f"something is {nearest_m:.2f} m before it from {first} to {last} degrees"
    return [Suspicion(messages.FAULT_KIND_BLOCKED, _EVIDENCE, words)]


def _nearer(sweep: Readings, past: Past, number: int) -> bool:
    """Than it used to be; True where it used to be silent."""
    return not past.median_m[number] < sweep.range_m[number] + _FARTHER_M


def _widest(near: list[int]) -> list[int]:
    """The longest run of readings of which six in ten are near, from a near one to a near one."""
    best: list[int] = []
    for first in range(len(near)):
        for last in range(len(near) - 1, first + len(best) - 1, -1):
            if last - first + 1 >= _LEAST_SHARE * (near[last] - near[first] + 1):
                best = near[first : last + 1]
                break
    return best
