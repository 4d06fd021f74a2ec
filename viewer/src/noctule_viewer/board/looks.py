"""What a unit has heard, sweep by sweep: bearings and ranges, for pictures from the unit's own place."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from noctule import poses
from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import (
    READING_STATUS_ECHO,
    READING_STATUS_NO_ECHO,
    READING_STATUS_UNSPECIFIED,
    Reading,
    Sweep,
)

MOST_LOOKS = 120  # of a unit: half an hour, at a sweep every 16 s
_MOST_UNITS = 60  # as strangers could name more; a unit's looks take up to 100 kB
AHEAD_S = 60.0  # a sweep that is dated later than now and this is so by a wrong clock
_FARTHEST_M = 20.0  # beyond any sensor's range
_ROOM_C = 20.0
_BEAM_RAD = radians(22.5)  # where nobody says: the mapper's own default


@dataclass(frozen=True)
class Look:
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


def look(sweep: Sweep) -> Look:
    """The sweep's readings, their ranges corrected as far as the sweep says how."""
    sensor = sweep.sensor
    celsius = sweep.air_temperature_c if sweep.HasField("air_temperature_c") else _ROOM_C
    flights_s = np.array([_flight_s(reading) for reading in sweep.readings])
    range_m = flights_s * speed_of_sound_m_s(celsius) / 2 - sensor.range_bias_m + sensor.face_offset_m
    return Look(
        time_s=sweep.start.ToNanoseconds() / 1e9,
        bearing_rad=np.array([reading.bearing_rad for reading in sweep.readings]),
        range_m=np.where((range_m > 0) & (range_m <= _FARTHEST_M), range_m, np.nan),
        silent=np.array([_heard_nothing(reading) for reading in sweep.readings], dtype=bool),
        beam_width_rad=sensor.beam_width_rad if sensor.HasField("beam_width_rad") else _BEAM_RAD,
        pose=_pose(sweep),
    )


class Looks:
    """The last looks of each unit, the newest last. For several threads, under a lock of theirs."""

    def __init__(self) -> None:
        self._looks: dict[str, deque[Look]] = {}

    def note(self, sweep: Sweep, now_s: float) -> None:
        """A sweep as it was made; one that is older than the newest is left out, and so is one without readings. What
        is dated in the future, by the UTC ``now_s``, gives way to what is older. The unit that was not heard for
        longest gives way to a new one.
        """
        if not sweep.readings:
            return
        made, before = look(sweep), self._looks.pop(sweep.unit, deque(maxlen=MOST_LOOKS))
        if len(self._looks) >= _MOST_UNITS:
            del self._looks[next(iter(self._looks))]
        self._looks[sweep.unit] = before
        while before and before[-1].time_s > now_s + AHEAD_S and before[-1].time_s > made.time_s:
            before.pop()
        if not before or made.time_s > before[-1].time_s:
            before.append(made)

    def all(self) -> dict[str, Sequence[Look]]:
        """By unit."""
        return {unit: tuple(looks) for unit, looks in self._looks.items()}


def _pose(sweep: Sweep) -> tuple[float, float, float] | None:
    pose = sweep.pose
    stated = sweep.HasField("pose") and not poses.is_unknown(pose)
    return (pose.x_m, pose.y_m, pose.heading_rad) if stated else None


def _flight_s(reading: Reading) -> float:
    echo = reading.status in (READING_STATUS_UNSPECIFIED, READING_STATUS_ECHO)
    return reading.time_of_flight_s if echo and reading.HasField("time_of_flight_s") else np.nan


def _heard_nothing(reading: Reading) -> bool:
    unsaid = reading.status == READING_STATUS_UNSPECIFIED and not reading.HasField("time_of_flight_s")
    return unsaid or reading.status == READING_STATUS_NO_ECHO
