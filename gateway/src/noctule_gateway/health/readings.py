"""A sweep as the detectors see it: bearings in rising order, each with a range, silence, or a kind of failure."""

import math
from dataclasses import dataclass

from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import (
    READING_STATUS_ECHO,
    READING_STATUS_UNSPECIFIED,
    ReadingStatus,
    Sweep,
)

_ASSUMED_AIR_C = 20.0


@dataclass(frozen=True)
class Readings:
    """One sweep, n readings by rising bearing; ``range_m`` is counted from the sensor, NaN where there was no echo.

    The ranges were computed with the speed of sound ``speed_m_s``; ``air_measured`` is False where the air's
    temperature was assumed. ``forward`` is whether the unit turned towards larger bearings; ``fixed`` whether it stands
    where it stood before.
    """

    bearing_rad: tuple[float, ...]
    range_m: tuple[float, ...]
    status: tuple[ReadingStatus, ...]
    speed_m_s: float
    air_measured: bool
    forward: bool
    fixed: bool
    start_ns: int  # UTC, of the clock's epoch ``clock_epoch``
    clock_epoch: str

    @property
    def heard(self) -> list[int]:
        """Which readings are echoes."""
        return [number for number, one_m in enumerate(self.range_m) if not math.isnan(one_m)]


def readings_of(sweep: Sweep, fixed: bool) -> Readings:
    """The sweep of the bus as Readings. Without a measured air temperature ranges are those at 20 degrees C."""
    air_measured = sweep.HasField("air_temperature_c")
    speed_m_s = speed_of_sound_m_s(sweep.air_temperature_c if air_measured else _ASSUMED_AIR_C)
    order = sorted(range(len(sweep.readings)), key=lambda number: sweep.readings[number].bearing_rad)
    readings = [sweep.readings[number] for number in order]
    echo = (READING_STATUS_UNSPECIFIED, READING_STATUS_ECHO)
    return Readings(
        bearing_rad=tuple(one.bearing_rad for one in readings),
        range_m=tuple(
            one.time_of_flight_s * speed_m_s / 2
            if one.status in echo and one.HasField("time_of_flight_s")
            else math.nan
            for one in readings
        ),
        status=tuple(one.status for one in readings),
        speed_m_s=speed_m_s,
        air_measured=air_measured,
        forward=len(order) < 2 or order[0] < order[-1],
        fixed=fixed,
        start_ns=sweep.start.ToNanoseconds(),
        clock_epoch=sweep.clock_epoch,
    )
