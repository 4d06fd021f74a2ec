"""A sweep as the mathematics sees it: a pose and arrays of bearings and corrected ranges, checked once, here."""

import math
from dataclasses import dataclass

import numpy as np

from noctule import messages_pb2
from noctule.errors import NoctuleError
from noctule_mapper.config import SensorConfig

_END_OF_TIME_S = 9e9  # in the year 2255; a count of nanoseconds ends soon after
_EDGE_OF_SITE_M = 1e4  # the fit was seen right up to 10 km from the origin: a pose beyond is of another frame
_WIDEST_SIGMA_M = 0.5  # a range that is no better known tells no wall from the next; millimetres are a likely slip
_COLDEST_AIR_C = -100.0  # no air on Earth is; the linear speed of sound is far from its range


class SweepError(NoctuleError):
    """A sweep that can't be mapped; the message names the sweep, what is wrong and what to do."""


@dataclass(frozen=True)
class SweepReadings:
    """One sweep. Arrays are (n,); a range is free of bias and of the air's temperature, NaN where there is no usable
    echo.
    """

    identity: tuple[str, int]  # log_id, log_sequence
    unit: str
    time_s: float  # since 1970 UTC
    x_m: float
    y_m: float
    heading_rad: float
    sigma_position_m: float
    sigma_heading_rad: float
    bearing_rad: np.ndarray
    range_m: np.ndarray
    no_echo: np.ndarray  # bool: the sensor listened and heard nothing
    beam_width_rad: float
    range_sigma_m: float | None  # None: not calibrated

    @property
    def direction_rad(self) -> np.ndarray:
        """Beam axes in the site's frame, (n,)."""
        return self.heading_rad + self.bearing_rad


def speed_of_sound_m_s(air_temperature_c: float) -> float:
    """Speed of sound in air, 331.3 + 0.606 T m/s."""
    return 331.3 + 0.606 * air_temperature_c


def identity_of(sweep: messages_pb2.Sweep) -> tuple[str, int]:
    """What a sweep is known by: its place in the gateway's log, or unit, boot and sequence if it was never in one."""
    if sweep.log_id:
        return sweep.log_id, sweep.log_sequence
    return f"{sweep.unit}/{sweep.boot}", sweep.sequence


def from_message(sweep: messages_pb2.Sweep, sensor: SensorConfig | None = None) -> SweepReadings:
    """The sweep's readings as arrays; ``sensor`` stands in for what the sweep does not say of its own.

    Raises SweepError where there is no pose or a number is not finite.
    """
    default = sensor or SensorConfig()
    if not sweep.HasField("pose"):
        raise SweepError(f"{_name(sweep)} has no pose: give the unit a pose, a path or a pose key in the site file")
    own = sweep.sensor if sweep.HasField("sensor") else messages_pb2.Sensor()
    bias_m = own.range_bias_m if own.HasField("range_bias_m") else default.range_bias_m
    sigma_m = own.range_sigma_m if own.HasField("range_sigma_m") else default.range_sigma_m
    width_rad = own.beam_width_rad if own.HasField("beam_width_rad") else default.beam_width_rad
    celsius = sweep.air_temperature_c if sweep.HasField("air_temperature_c") else default.air_temperature_c
    if sigma_m is not None and not 0 < sigma_m < math.inf:
        raise SweepError(f"{_name(sweep)} has range_sigma_m {sigma_m}: leave it out where it is not known")
    if sigma_m is not None and sigma_m > _WIDEST_SIGMA_M:
        raise SweepError(
            f"{_name(sweep)} has range_sigma_m {sigma_m}: give it in metres, or leave it out where it is not known"
        )
    if not math.isfinite(bias_m):
        raise SweepError(f"{_name(sweep)} has range_bias_m {bias_m}: leave it out where it is not known")
    if not _COLDEST_AIR_C < celsius < math.inf:
        raise SweepError(f"{_name(sweep)} has air_temperature_c {celsius}: leave it out where it is not measured")
    if not 0 < width_rad <= math.pi:
        raise SweepError(f"{_name(sweep)} has beam_width_rad {width_rad}: give the full width, above 0 and up to pi")
    range_m = _flights_s(sweep) * speed_of_sound_m_s(celsius) / 2 - bias_m
    range_m[(range_m < default.shortest_range_m) | (range_m > default.longest_range_m)] = np.nan
    readings = SweepReadings(
        identity=identity_of(sweep),
        unit=sweep.unit,
        time_s=sweep.start.seconds + sweep.start.nanos * 1e-9,
        x_m=sweep.pose.x_m,
        y_m=sweep.pose.y_m,
        heading_rad=sweep.pose.heading_rad,
        sigma_position_m=sweep.pose.sigma_position_m,
        sigma_heading_rad=sweep.pose.sigma_heading_rad,
        bearing_rad=np.array([reading.bearing_rad for reading in sweep.readings], dtype=float),
        range_m=range_m,
        no_echo=np.array([_heard_nothing(reading) for reading in sweep.readings], dtype=bool),
        beam_width_rad=width_rad,
        range_sigma_m=sigma_m,
    )
    _check_finite(sweep, readings)
    return readings


def _flights_s(sweep: messages_pb2.Sweep) -> np.ndarray:
    """Times of flight, (n,), NaN where there was no echo or none that a reflector can have made."""
    echo = (messages_pb2.READING_STATUS_UNSPECIFIED, messages_pb2.READING_STATUS_ECHO)
    flights_s = np.full(len(sweep.readings), np.nan)
    for index, reading in enumerate(sweep.readings):
        if reading.status in echo and reading.HasField("time_of_flight_s"):
            if not math.isfinite(reading.time_of_flight_s):
                raise SweepError(
                    f"{_name(sweep)}, reading {index}: time_of_flight_s is not finite; leave it out for no echo"
                )
            flights_s[index] = reading.time_of_flight_s
    return flights_s


def _heard_nothing(reading: messages_pb2.Reading) -> bool:
    unsaid = reading.status == messages_pb2.READING_STATUS_UNSPECIFIED and not reading.HasField("time_of_flight_s")
    return unsaid or reading.status == messages_pb2.READING_STATUS_NO_ECHO


def _check_finite(sweep: messages_pb2.Sweep, readings: SweepReadings) -> None:
    if not 0 <= readings.time_s < _END_OF_TIME_S:
        raise SweepError(f"{_name(sweep)} starts at {readings.time_s:g} s of Unix time, out of reach; mend its clock")
    if max(abs(readings.x_m), abs(readings.y_m)) > _EDGE_OF_SITE_M:
        raise SweepError(f"{_name(sweep)} lies {_EDGE_OF_SITE_M:g} m or more from the site's origin; mend its pose")
    for field in (
        "time_s",
        "x_m",
        "y_m",
        "heading_rad",
        "sigma_position_m",
        "sigma_heading_rad",
        "bearing_rad",
    ):
        if not np.all(np.isfinite(getattr(readings, field))):
            raise SweepError(f"{_name(sweep)}: {field} is not finite; mend or drop the sweep")
    if readings.sigma_position_m < 0 or readings.sigma_heading_rad < 0:
        raise SweepError(f"{_name(sweep)}: a standard deviation is negative; mend its pose")


def _name(sweep: messages_pb2.Sweep) -> str:
    log_id, number = identity_of(sweep)
    return f"sweep {number} of {log_id!r} (unit {sweep.unit!r})"
