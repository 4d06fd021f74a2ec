"""One value at every bearing: the sensor repeats itself, the motor is stuck, or something covers the sensor.

One reflector answers within the lobe, 40 degrees at the most, so a range that comes from all round takes a reflector
for each 40 degrees, all equally far. Four there may be: the walls of a closet about a unit in its middle. Which of the
three it is, the value's scatter tells: what is measured scatters by millimetres, what is repeated does not.
"""

import math
from statistics import median

from noctule import messages_pb2 as messages
from noctule_gateway.health.past import Past
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion

_ALIKE_M = 0.03  # noise of 3 mm, and echoes that are one or two cycles late, 4.3 mm each
_LOBE_RAD = math.radians(40.0)
_MOST_REFLECTORS = 4
_LEAST_SHARE = 0.6  # of the readings: of a stuck motor's 8 % are lost and 4 % false
_EXACT_M = 0.0005  # median deviation; a measured one is 2 mm, a repeated one at most the tick of the sensor's own clock
_NEAR_M = 0.2
_MOST_VALUES = 4
_EVIDENCE = 25.0


def suspicions(sweep: Readings, past: Past | None) -> list[Suspicion]:
    """One of the three, where one value, or exactly repeated ones in turns, make up most of the sweep."""
    left, repeats, values, exact = sweep.heard, 0, [], True
    while left and len(values) < _MOST_VALUES:
        alike = _most_alike(sweep, left)
        if _reflectors([sweep.bearing_rad[number] for number in alike]) > _MOST_REFLECTORS:
            middle = median(sweep.range_m[number] for number in alike)
            spread = median(abs(sweep.range_m[number] - middle) for number in alike)
            if values and not (exact and spread <= _EXACT_M):
                break  # several values that scatter are a room's
            exact = spread <= _EXACT_M
            values.append(middle)
            repeats += len(alike)
        left = [number for number in left if number not in alike]
    if not values or repeats < _LEAST_SHARE * len(sweep.range_m):
        return []
    listed = ", ".join(f"{value:.2f} m" for value in values)
    if exact:
        return [Suspicion(messages.FAULT_KIND_REPEATS, _EVIDENCE, f"the sensor repeats {listed} at every bearing")]
    if values[0] < _NEAR_M and not _was_heard(past, values[0]):
        return [Suspicion(messages.FAULT_KIND_BLOCKED, _EVIDENCE, f"something is {listed} before it at every bearing")]
    return [Suspicion(messages.FAULT_KIND_MOTOR_STUCK, _EVIDENCE, f"it hears the same at every bearing, at {listed}")]


def _was_heard(past: Past | None, range_m: float) -> bool:
    """A reflector stood there before: a stuck motor faces one, and what covers the sensor is there by chance."""
    return past is not None and any(abs(past.median_m[n] - range_m) <= _ALIKE_M / 2 for n in past.stable())


def _most_alike(sweep: Readings, numbers: list[int]) -> set[int]:
    """Those of ``numbers`` within the window of ranges that holds the most."""
    by_range = sorted(numbers, key=lambda number: sweep.range_m[number])
    best: list[int] = []
    first = 0
    for last, number in enumerate(by_range):
        while sweep.range_m[number] - sweep.range_m[by_range[first]] > _ALIKE_M:
            first += 1
        if last - first + 1 > len(best):
            best = by_range[first : last + 1]
    return set(best)


def _reflectors(bearing_rad: list[float]) -> int:
    """How many reflectors it takes to answer at all these bearings."""
    count, until_rad = 0, -math.inf
    for each_rad in sorted(bearing_rad):
        if each_rad > until_rad:
            count, until_rad = count + 1, each_rad + _LOBE_RAD
    return count
