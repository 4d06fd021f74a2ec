"""Persistence: which echoes of a unit that stands still are of the room, and which of somebody who walks through it.

Sweep after sweep from one pose hears the same room. In the frame {occupied, free} of what stands at an echo's range, a
sweep that hears it again says occupied, one that hears only what lies behind it, or nothing, says free, and one that
something nearer hides it from says nothing. An echo lasts while the sweeps of its place agree with it: all of them, so
that who walks by is no part of the map, and their newer half, so that what has gone for good is not either.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.sweep import SweepReadings

_SAME_RANGE_SIGMAS = 4.0  # of the difference of two ranges
_UNKNOWN_SIGMA_M = 0.01  # of a sensor that nobody has calibrated: rather too wide than that a wall is lost
_LATE_M = 0.0043  # an echo may be heard a cycle late: 25 us of sound there and back
_SAME_BEARING_STEPS = 0.5
_NEXT_BEARING_STEPS = 1.3  # a reflector at the edge of the lobe answers now at this bearing and now at the next
_LEAST_SHARE = 0.5  # of the sweeps that say something of an echo
_WITNESSES = 8  # the newest sweeps judge all: a change is taken over in as many, however many are kept
_NEWEST = 2  # of the sweeps are the newer half at least: one alone proves nothing


def lasting(sweeps: Sequence[SweepReadings]) -> list[np.ndarray]:
    """Which readings of each sweep are echoes that last, bool (n,); ``sweeps`` are those of one pose as they came."""
    heard = [np.isfinite(sweep.range_m) for sweep in sweeps]
    if len(sweeps) <= _NEWEST:
        return heard
    bearing_rad = np.concatenate([sweep.bearing_rad[at] for sweep, at in zip(sweeps, heard, strict=True)])
    range_m = np.concatenate([sweep.range_m[at] for sweep, at in zip(sweeps, heard, strict=True)])
    witnesses = sweeps[-_WITNESSES:]
    says = np.stack([_says(sweep, bearing_rad, range_m) for sweep in witnesses], axis=1)
    newer = says[:, -max(_NEWEST, len(witnesses) // 2) :]
    lasts = np.split(_agreed(says) & _agreed(newer), np.cumsum([at.sum() for at in heard])[:-1])
    return [_spread_over(at, one) for at, one in zip(heard, lasts, strict=True)]


def _says(sweep: SweepReadings, bearing_rad: np.ndarray, range_m: np.ndarray) -> np.ndarray:
    """What a sweep says of echoes (n,) of its place: 1 occupied, -1 free, 0 nothing."""
    listened = np.isfinite(sweep.range_m) | sweep.no_echo
    if not listened.any():
        return np.zeros(len(range_m), int)
    looks_m = np.where(sweep.no_echo, np.inf, sweep.range_m)[listened]
    steps = np.abs(wrapped(bearing_rad[:, None] - sweep.bearing_rad[listened])) / sweep.step_rad
    same_m = _SAME_RANGE_SIGMAS * np.sqrt(2) * (sweep.range_sigma_m or _UNKNOWN_SIGMA_M) + _LATE_M
    occupied = ((steps <= _NEXT_BEARING_STEPS) & (np.abs(looks_m - range_m[:, None]) <= same_m)).any(axis=1)
    free = ((steps <= _SAME_BEARING_STEPS) & (looks_m > range_m[:, None] + same_m)).any(axis=1)
    return np.where(occupied, 1, np.where(free, -1, 0))


def _agreed(says: np.ndarray) -> np.ndarray:
    """Whether of the sweeps (n, sweeps) that say something of an echo enough call it occupied, (n,)."""
    return (says > 0).sum(axis=1) >= _LEAST_SHARE * (says != 0).sum(axis=1)


def _spread_over(heard: np.ndarray, lasts: np.ndarray) -> np.ndarray:
    whole = heard.copy()
    whole[heard] = lasts
    return whole
