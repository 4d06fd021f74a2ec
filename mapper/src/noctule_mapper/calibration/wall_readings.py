"""Repeated readings of one wall, sorted by the place that they were taken from."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from noctule.errors import NoctuleError
from noctule_mapper.readings import arrays
from noctule_mapper.readings.angles import wrapped
from noctule_mapper.readings.sweep import SweepReadings

LEAST_REPEATS = 5  # of the reading at a place, below which it tells little of the spread
_SAME_PLACE_M = 0.01
_SAME_DIRECTION_RAD = math.radians(3.0)


class CalibrationError(NoctuleError):
    """A survey that no calibration can be had from; the message says what it lacks and what to do."""


@dataclass(frozen=True)
class WallReadings:
    """Echoes of one wall. Places are (places,) in the order in which they were first read, readings (n,): those of a
    place stand together, in order of time.
    """

    x_m: np.ndarray = field(metadata=arrays.SHARED)
    y_m: np.ndarray = field(metadata=arrays.SHARED)
    facing_rad: float = field(metadata=arrays.SHARED)  # the beams' axis in the site's frame
    place: np.ndarray  # int, of each reading
    range_m: np.ndarray

    take = arrays.take  # of the readings: the places stay

    def at(self, place: int) -> np.ndarray:
        """The ranges read at ``place``, (repeats,)."""
        return self.range_m[self.place == place]


def wall_readings(sweeps: Sequence[SweepReadings], facing_rad: float | None = None) -> WallReadings:
    """The echoes within 3 degrees of ``facing_rad`` (site's frame; None: the only direction there is) that were
    repeated at their place.

    Raises CalibrationError where the sweeps look in several directions and none is told, or repeat no reading.
    """
    x_m, y_m, axis_rad, range_m = _echoes(sweeps)
    place, places_m = _places(x_m, y_m)
    if facing_rad is None:
        facing_rad = _only_direction_rad(axis_rad)
    alike = np.abs(wrapped(axis_rad - facing_rad)) <= _SAME_DIRECTION_RAD
    repeats = np.bincount(place[alike], minlength=len(places_m))
    repeated = repeats >= LEAST_REPEATS
    if not repeated.any():
        raise CalibrationError(
            f"no place has {LEAST_REPEATS} echoes from {math.degrees(facing_rad):.1f} degrees: "
            "repeat the reading at each place, 50 times as the paper does, and name the wall's direction rightly"
        )
    number = np.cumsum(repeated) - 1
    chosen = np.flatnonzero(alike & repeated[place])
    chosen = chosen[np.argsort(place[chosen], kind="stable")]
    kept_m = places_m[repeated]
    return WallReadings(kept_m[:, 0], kept_m[:, 1], facing_rad, number[place[chosen]], range_m[chosen])


def _echoes(sweeps: Sequence[SweepReadings]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places, axes and ranges of all echoes in order of time, each (n,)."""
    rows = [
        (sweep.x_m, sweep.y_m, axis_rad, range_m)
        for sweep in _in_order_of_time(sweeps)
        for axis_rad, range_m in zip(sweep.direction_rad, sweep.range_m, strict=True)
        if np.isfinite(range_m)
    ]
    if not rows:
        raise CalibrationError("the survey has no echo: point the sensor at a wall and survey again")
    x_m, y_m, axis_rad, range_m = np.array(rows).T
    return x_m, y_m, axis_rad, range_m


def _in_order_of_time(sweeps: Sequence[SweepReadings]) -> list[SweepReadings]:
    """By their times within an epoch of the clock, the epochs in the order in which the survey has them."""
    epochs = {epoch: number for number, epoch in enumerate(dict.fromkeys(sweep.clock_epoch for sweep in sweeps))}
    return sorted(sweeps, key=lambda sweep: (epochs[sweep.clock_epoch], sweep.time_s))


def _places(x_m: np.ndarray, y_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The place of each echo, int (n,), and the places, (places, 2): poses within a centimetre of the first are one."""
    spots, first, spot_of = np.unique(np.stack([x_m, y_m], axis=1), axis=0, return_index=True, return_inverse=True)
    leaders: list[np.ndarray] = []
    place_of_spot = np.empty(len(spots), int)
    for index in np.argsort(first):
        near = [number for number, leader in enumerate(leaders) if math.dist(leader, spots[index]) <= _SAME_PLACE_M]
        place_of_spot[index] = near[0] if near else len(leaders)
        if not near:
            leaders.append(spots[index])
    place = place_of_spot[spot_of.ravel()]
    count = np.bincount(place)
    return place, np.stack([np.bincount(place, x_m) / count, np.bincount(place, y_m) / count], axis=1)


def _only_direction_rad(axis_rad: np.ndarray) -> float:
    mean_rad = math.atan2(np.sin(axis_rad).mean(), np.cos(axis_rad).mean())
    if np.all(np.abs(wrapped(axis_rad - mean_rad)) <= _SAME_DIRECTION_RAD):
        return mean_rad
    seen_deg = np.unique(np.rint(np.degrees(wrapped(axis_rad))).astype(int))
    listed = ", ".join(str(each) for each in seen_deg[:12]) + (", ..." if len(seen_deg) > 12 else "")
    raise CalibrationError(
        f"the sweeps have echoes from several directions of the site ({listed} degrees): name the wall's, --facing-deg"
    )
