"""What a fixed unit has heard at each of its bearings: the last sweeps that were well, in fixed memory.

Of a bearing the median, the median deviation and the share of silence are wanted, each robust against a share of
wrong entries of nearly a half. Fifteen entries give a share to 13 % (one standard deviation). Once there are so many,
one sweep in four enters, so that the past reaches back sixty sweeps: what changes more slowly than that is taken for
the room's, or the air's.
"""

import math
from collections import deque
from collections.abc import Collection, Sequence
from statistics import median

from noctule_gateway.health.readings import Readings

ENOUGH = 6  # entries, from which on the past is asked
_KEPT = 15
_EVERY = 4  # so many well sweeps to an entry, once the past is full
_SAME_BEARING_RAD = math.radians(1.0)  # the motor rests within a half step, 0.09 degrees, of where it should
_STABLE_SHARE, _STABLE_M = 0.6, 0.02
_AGREES_M, _FEW = 0.025, 3

Row = tuple[float, ...]


class Past:
    """Ranges by bearing (NaN for silence) of up to 15 sweeps of one plan, all with the air measured or all
    with it assumed. What it tells is worked out at each entry."""

    def __init__(
        self, bearing_rad: Sequence[float] = (), rows: Sequence[Row] = (), skipped: int = 0, air_measured: bool = False
    ) -> None:
        self.bearing_rad = tuple(bearing_rad)
        self.rows: deque[Row] = deque(rows, _KEPT)
        self.skipped, self.air_measured = skipped, air_measured
        self._work_out()

    def __len__(self) -> int:
        return len(self.rows)

    @property
    def is_enough(self) -> bool:
        """It may be asked."""
        return len(self.rows) >= ENOUGH

    @property
    def mean_heard_share(self) -> float:
        """Of all bearings."""
        return sum(self.heard_share) / len(self.heard_share)

    @property
    def is_full(self) -> bool:
        """It has as many entries as it ever has."""
        return len(self.rows) == _KEPT

    def fits_plan(self, sweep: Readings) -> bool:
        """The sweep was made at the same bearings, and its air measured or assumed alike."""
        return sweep.air_measured == self.air_measured and _same_bearings(sweep.bearing_rad, self.bearing_rad)

    def add(self, sweep: Readings, but: Collection[int] = ()) -> bool:
        """Take in a sweep that is well; False if it is passed over. At the bearings ``but`` it stays as it was."""
        if self.is_full and self.skipped < _EVERY - 1:
            self.skipped += 1
            return False
        self.skipped = 0
        self.rows.append(tuple(self.median_m[n] if n in but else one_m for n, one_m in enumerate(sweep.range_m)))
        self._work_out()
        return True

    def stable(self) -> list[int]:
        """The bearings that mostly answer, and then at one range to within 2 cm."""
        return self._stable

    def agrees(self, sweeps: Sequence[Readings], but: Collection[int]) -> bool:
        """Of the ``sweeps``' echoes at stable bearings other than ``but`` half are as before; True where few answer."""
        off_m = [
            abs(sweep.range_m[n] - self.median_m[n])
            for sweep in sweeps
            for n in self._stable
            if n not in but and not math.isnan(sweep.range_m[n])
        ]
        return len(off_m) < _FEW or sum(one_m <= _AGREES_M for one_m in off_m) * 2 >= len(off_m)

    def _work_out(self) -> None:
        self.heard: list[list[float]] = [
            sorted(row[number] for row in self.rows if not math.isnan(row[number]))
            for number in range(len(self.bearing_rad))
        ]
        entries = len(self.rows)
        self.heard_share = [(len(each) + 0.5) / (entries + 1) for each in self.heard]
        """By bearing, never 0 or 1: of n entries half a one more of each kind is assumed."""
        self.median_m = [median(each) if each else math.nan for each in self.heard]
        self._stable = [
            number
            for number, each in enumerate(self.heard)
            if len(each) >= _STABLE_SHARE * entries and each and _deviation(each, self.median_m[number]) <= _STABLE_M
        ]


def same_plan(sweep: Readings, other: Readings) -> bool:
    """Both sweeps were made at the same bearings, and the air measured or assumed for both."""
    return sweep.air_measured == other.air_measured and _same_bearings(sweep.bearing_rad, other.bearing_rad)


def _same_bearings(bearings_rad: Sequence[float], others_rad: Sequence[float]) -> bool:
    return len(bearings_rad) == len(others_rad) and all(
        abs(one - other) <= _SAME_BEARING_RAD for one, other in zip(bearings_rad, others_rad, strict=True)
    )


def _deviation(values: Sequence[float], middle: float) -> float:
    return median(abs(one - middle) for one in values)
