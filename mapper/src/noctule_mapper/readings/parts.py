"""Parts: the sweeps of a site that may tell of the same reflectors. What lies far apart is fitted apart.

How far apart two places may be, the survey's own density says. Along a dense path the next places tell all that there
is to tell of a reflector; where stops are few the next ones are farther. Fine sweeps are compared at any distance from
which one reflector answers both, since their plateaus tell what they share.
"""

from collections.abc import Sequence

import numpy as np

from noctule_mapper.config import PartConfig
from noctule_mapper.readings.components import connected_components
from noctule_mapper.readings.looks import is_fine
from noctule_mapper.readings.sweep import SweepReadings


def parts_of(sweeps: Sequence[SweepReadings], config: PartConfig) -> list[list[SweepReadings]]:
    """The sweeps part by part, each in their order, the parts by their first sweep."""
    if not sweeps:
        return []
    at_m = np.array([(sweep.x_m, sweep.y_m) for sweep in sweeps])
    squares, place = np.unique(np.rint(at_m / config.same_place_m), axis=0, return_inverse=True)
    place = place.ravel()
    fine = np.bincount(place, [is_fine(sweep) for sweep in sweeps]) > 0
    x_m, y_m = squares.T * config.same_place_m
    first, second = _neighbours(x_m, y_m, fine, config)
    part_of_square = connected_components(first, second, len(squares))
    parts: dict[int, list[SweepReadings]] = {}
    for sweep, part in zip(sweeps, part_of_square[place], strict=True):
        parts.setdefault(int(part), []).append(sweep)
    return list(parts.values())


def stops_are_rare(sweeps: Sequence[SweepReadings], config: PartConfig) -> bool:
    """Whether the places are so far apart that the next ones are out of the reach of a dense path, two of them at
    least: by the second nearest place of most, where there are three.
    """
    at_m = np.array([(sweep.x_m, sweep.y_m) for sweep in sweeps]).reshape(-1, 2)
    x_m, y_m = (np.unique(np.rint(at_m / config.same_place_m), axis=0) * config.same_place_m).T
    if len(x_m) < 2:
        return False
    first, second, _ = _pairs_within(x_m, y_m, config.reach_m / config.steps)
    around = np.bincount(np.concatenate([first, second]), minlength=len(x_m))
    return bool(np.median(around) < min(_NEAREST, len(x_m) - 1))


def _neighbours(
    x_m: np.ndarray, y_m: np.ndarray, fine: np.ndarray, config: PartConfig
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of places (pairs,) of which one lies within reach of the other."""
    first, second, away_m = _pairs_within(x_m, y_m, config.reach_m)
    near = away_m <= config.reach_m / config.steps
    around = np.bincount(np.concatenate([first[near], second[near]]), minlength=len(x_m))
    sparse = np.nonzero((around < _NEAREST) | fine)[0]
    away_m = np.hypot(x_m[sparse, None] - x_m, y_m[sparse, None] - y_m)
    nearest = np.sort(away_m, axis=1)[:, min(_NEAREST, len(x_m) - 1)] if len(sparse) else np.zeros(0)
    reach_m = np.where(fine[sparse], np.inf, np.maximum(config.steps * nearest, config.reach_m))
    far, other = np.nonzero(away_m <= np.minimum(reach_m, config.most_reach_m)[:, None])
    return np.concatenate([first, sparse[far]]), np.concatenate([second, other])


_NEAREST = 2  # the place before and the one behind


def _pairs_within(x_m: np.ndarray, y_m: np.ndarray, reach_m: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Numbers of all places (pairs,) no farther apart than ``reach_m``, and how far they are; each pair once."""
    order = np.argsort(x_m)
    beyond = np.searchsorted(x_m[order], x_m[order] + reach_m, side="right")
    count = beyond - np.arange(len(order)) - 1
    first = np.repeat(np.arange(len(order)), count)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
    first, second = order[first], order[second]
    away_m = np.hypot(x_m[first] - x_m[second], y_m[first] - y_m[second])
    near = away_m <= reach_m
    return first[near], second[near], away_m[near]
