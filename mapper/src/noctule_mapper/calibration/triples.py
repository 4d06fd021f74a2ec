"""Triples of collinear places along a wall, and by how much their readings fail Eq. 1."""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from noctule_mapper.calibration.wall_readings import WallReadings
from noctule_mapper.readings.collinear import deviation_scale, off_line_m, reference_range_m

_NEIGHBOURS = 8  # of a place, among which the other two of its triple are sought
_OFF_LINE_M = 0.005
_SHORTEST_M, _LONGEST_M = 0.05, 1.0  # from the middle place to another
_MOST_SLANT = 0.5  # cosine between the triple's line and the beams' axis


@dataclass(frozen=True)
class Triple:
    """Three collinear places by number, ``second`` between the others, and the distances of Eq. 1."""

    first: int
    second: int
    third: int
    d12_m: float
    d13_m: float

    @property
    def scale(self) -> float:
        """Sigma of d = R2d - R2 in sigmas of a range: sqrt(1.5) where the second place is in the middle."""
        return float(deviation_scale(self.d12_m, self.d13_m))


def triples(readings: WallReadings) -> list[Triple]:
    """Triples of adjacent places, most parallel to the wall and shortest first; no place is in two of them, so that
    their deviations are independent.
    """
    found = sorted(_candidates(readings), key=lambda candidate: candidate[0])
    taken: set[int] = set()
    chosen = []
    for _, triple in found:
        members = {triple.first, triple.second, triple.third}
        if not members & taken:
            chosen.append(triple)
            taken |= members
    return chosen


def deviations_m(readings: WallReadings, triple: Triple) -> np.ndarray:
    """d = R2d - R2 (Eq. 1) of a triple's repeats, (repeats,): the k-th readings of the three places go together."""
    ranges_m = [readings.at(place) for place in (triple.first, triple.second, triple.third)]
    repeats = min(map(len, ranges_m))
    r1, r2, r3 = (each[:repeats] for each in ranges_m)
    return reference_range_m(r1, r3, triple.d12_m, triple.d13_m) - r2


def _candidates(readings: WallReadings) -> list[tuple[tuple[float, float, int], Triple]]:
    """All triples of near neighbours, each with what it is chosen by."""
    places_m = np.stack([readings.x_m, readings.y_m], axis=1)
    axis = np.array([math.cos(readings.facing_rad), math.sin(readings.facing_rad)])
    found = []
    for second, middle in enumerate(places_m):
        away_m = np.hypot(*(places_m - middle).T)
        near = [int(each) for each in np.argsort(away_m, kind="stable")[1 : _NEIGHBOURS + 1]]
        for first, third in combinations([each for each in near if _SHORTEST_M <= away_m[each] <= _LONGEST_M], 2):
            line = places_m[third] - places_m[first]
            span_m = float(np.hypot(*line))
            to_middle = middle - places_m[first]
            along_m = float(to_middle @ line) / span_m
            off_m = float(off_line_m(*(places_m[first] - middle), *(places_m[third] - middle)))
            slant = abs(float(line @ axis)) / span_m
            if off_m <= _OFF_LINE_M and _SHORTEST_M <= along_m <= span_m - _SHORTEST_M and slant <= _MOST_SLANT:
                triple = Triple(first, second, third, along_m, span_m)
                found.append(((round(slant, 2), round(span_m, 3), second), triple))
    return found
