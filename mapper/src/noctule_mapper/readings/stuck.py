"""A stuck sensor: one that repeats a range, or a few in turns, at bearings that no room answers alike.

One reflector answers within the lobe, so a range that comes from all round needs a reflector for each width of the
lobe, all equally far to within two centimetres. Four there may be: the walls of a closet about a unit in its very
middle. More are the sensor's own doing, or a cloth's that hangs over it.
"""

import math

import numpy as np

_ALIKE_M = 0.02  # ranges of one value, the noise and whole centimetres included
_LOBE_RAD = math.radians(40.0)  # the whole lobe where it is widest, at 0.2 m
_MOST_REFLECTORS = 4  # equally far away
_LEAST_SHARE = 0.8  # of the bearings at which the sensor listened


def repeated_ranges_m(
    bearing_rad: np.ndarray, range_m: np.ndarray, beam_width_rad: float, listened: int
) -> list[float]:
    """The ranges that a stuck sensor repeats, none where the sensor is not stuck.

    ``bearing_rad`` and ``range_m`` are those of the echoes, (n,), of ``listened`` bearings in all.
    """
    lobe_rad, found, repeats = max(beam_width_rad, _LOBE_RAD), [], 0
    order = np.argsort(bearing_rad)
    bearing_rad, range_m = bearing_rad[order], range_m[order]
    while len(range_m):
        alike = _most_alike(range_m)
        if _reflectors(bearing_rad[alike], lobe_rad) > _MOST_REFLECTORS:
            found.append(float(np.median(range_m[alike])))
            repeats += int(alike.sum())
        bearing_rad, range_m = bearing_rad[~alike], range_m[~alike]
    return found if found and repeats >= _LEAST_SHARE * listened else []


def _most_alike(range_m: np.ndarray) -> np.ndarray:
    """The most of the ranges that are alike, bool (n,)."""
    above_m = range_m[None, :] - range_m[:, None]
    alike = (above_m >= 0) & (above_m <= _ALIKE_M)
    return alike[alike.sum(axis=1).argmax()]


def _reflectors(bearing_rad: np.ndarray, lobe_rad: float) -> int:
    """How many reflectors it takes to answer at all these bearings, which rise."""
    count, until_rad = 0, -math.inf
    for each_rad in bearing_rad:
        if each_rad > until_rad:
            count, until_rad = count + 1, each_rad + lobe_rad
    return count
