"""What a unit has heard, sweep by sweep: bearings and ranges, for pictures from the unit's own place."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from noctule import poses
from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import Sweep
from noctule.readings import flight_s, heard_nothing

MOST_SWEEPS = 120  # of a unit: half an hour, at a sweep every 16 s
_MOST_UNITS = 60  # as strangers could name more; a unit's sweeps take up to 100 kB
AHEAD_S = 60.0  # what is dated further into the future was dated by a wrong clock
_FARTHEST_M = 20.0  # beyond any sensor's range
_ROOM_C = 20.0
_BEAM_RAD = radians(22.5)  # where nobody says: the mapper's own default


@dataclass(frozen=True)
class HeardSweep:
    """One sweep. Arrays are (n,); ranges are NaN where there was no echo. A reading that is neither echo nor silence is
    a fault of the sensor.
    """

    time_s: float  # UTC
    bearing_rad: np.ndarray
    range_m: np.ndarray
    silent: np.ndarray  # bool: the sensor listened and heard nothing
    beam_width_rad: float
    pose: tuple[float, float, float] | None  # x_m, y_m, heading_rad in the site's frame; None: not known

    @property
    def faulty(self) -> np.ndarray:
        """(n,) bool."""
        return ~self.silent & np.isnan(self.range_m)


def heard_sweep(sweep: Sweep) -> HeardSweep:
    """The sweep's readings, their ranges corrected as far as the sweep says how."""
    sensor = sweep.sensor
    celsius = sweep.air_temperature_c if sweep.HasField("air_temperature_c") else _ROOM_C
    flights_s = np.array([flight_s(reading) for reading in sweep.readings], dtype=float)  # None is NaN
    range_m = flights_s * speed_of_sound_m_s(celsius) / 2 - sensor.range_bias_m + sensor.face_offset_m
    return HeardSweep(
        time_s=sweep.start.ToNanoseconds() / 1e9,
        bearing_rad=np.array([reading.bearing_rad for reading in sweep.readings]),
        range_m=np.where((range_m > 0) & (range_m <= _FARTHEST_M), range_m, np.nan),
        silent=np.array([heard_nothing(reading) for reading in sweep.readings], dtype=bool),
        beam_width_rad=sensor.beam_width_rad if sensor.HasField("beam_width_rad") else _BEAM_RAD,
        pose=_pose(sweep),
    )


class HeardSweeps:
    """The last sweeps of each unit, the newest last. For several threads, under a lock of theirs."""

    def __init__(self) -> None:
        self._sweeps: dict[str, deque[HeardSweep]] = {}

    def note(self, sweep: Sweep, now_s: float) -> None:
        """A sweep as it was made; one that is older than the newest is left out, and so is one without readings. What
        is dated in the future, by the UTC ``now_s``, gives way to what is older. The unit that was not heard for
        longest gives way to a new one.
        """
        if not sweep.readings:
            return
        made, before = heard_sweep(sweep), self._sweeps.pop(sweep.unit, deque(maxlen=MOST_SWEEPS))
        if len(self._sweeps) >= _MOST_UNITS:
            del self._sweeps[next(iter(self._sweeps))]
        self._sweeps[sweep.unit] = before
        while before and before[-1].time_s > now_s + AHEAD_S and before[-1].time_s > made.time_s:
            before.pop()
        if not before or made.time_s > before[-1].time_s:
            before.append(made)

    def all(self) -> dict[str, Sequence[HeardSweep]]:
        """By unit."""
        return {unit: tuple(sweeps) for unit, sweeps in self._sweeps.items()}


def _pose(sweep: Sweep) -> tuple[float, float, float] | None:
    pose = sweep.pose
    stated = sweep.HasField("pose") and not poses.is_unknown(pose)
    return (pose.x_m, pose.y_m, pose.heading_rad) if stated else None
