"""A sweep as the mathematics sees it: a pose and arrays of bearings and corrected ranges, checked once, here."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from noctule import bounds, messages_pb2
from noctule.air import speed_of_sound_m_s
from noctule.errors import NoctuleError
from noctule.readings import flight_s, heard_nothing
from noctule_mapper.config import LONGEST_RANGE_M, SHORTEST_RANGE_M, SensorConfig
from noctule_mapper.readings import faulty
from noctule_mapper.readings.stuck import repeated_ranges_m

# The bounds of a message hold for what is made of it too: the mathematics is right within them, and takes neither time
# nor memory without bound.
_BOUNDS = {
    "time_s": bounds.number("Timestamp", "seconds"),
    "x_m": bounds.number("Pose", "x_m"),
    "y_m": bounds.number("Pose", "y_m"),
    "heading_rad": bounds.number("Pose", "heading_rad"),
    "sigma_position_m": bounds.number("Pose", "sigma_position_m"),
    "sigma_heading_rad": bounds.number("Pose", "sigma_heading_rad"),
    "bearing_rad": bounds.number("Reading", "bearing_rad"),
    "range_m": bounds.Number(SHORTEST_RANGE_M, LONGEST_RANGE_M, "m"),
    "beam_width_rad": bounds.number("Sensor", "beam_width_rad"),
    "range_sigma_m": bounds.number("Sensor", "range_sigma_m"),
    "range_bias_m": bounds.number("Sensor", "range_bias_m"),
    "face_offset_m": bounds.number("Sensor", "face_offset_m"),
    "face_offset_sigma_m": bounds.number("Sensor", "face_offset_sigma_m"),
    "air_temperature_c": bounds.number("Sweep", "air_temperature_c"),
}


class SweepError(NoctuleError):
    """A sweep that can't be mapped; the message names the sweep, what is wrong and what to do. ``kind`` is the same for
    all sweeps with which the same is wrong.
    """

    def __init__(self, message: str, kind: str) -> None:
        super().__init__(message)
        self.kind = kind


class FaultyUnitError(SweepError):
    """A sweep made while its gateway knew of a fault of the unit."""


class StuckSensorError(SweepError):
    """A sweep whose sensor repeats what it says instead of measuring."""


@dataclass(frozen=True)
class SweepReadings:
    """One sweep. Arrays are (n,); a range is counted from the axis about which the unit turns, free of bias and of the
    air's temperature, NaN where there is no usable echo.

    Raises SweepError where a number is one that no sweep has: none that could overflow, or take time or memory without
    bound, comes to the map.
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
    sigma_bias_m: float = 0.0  # of the mean error of the sensor's ranges, where nobody has measured it
    face_offset_m: float = 0.0  # from the axis to the sensor's face, along the beam: ranges have it in them
    face_offset_sigma_m: float = 0.0
    sigma_scale: float = 0.0  # of the speed of sound as a share of it, where nobody has measured the air
    clock_epoch: str = ""  # only times of one epoch can be compared; "" where its gateway does not name one

    def __post_init__(self) -> None:
        name, readings = _name(self.identity, self.unit), len(self.bearing_rad)
        if not readings == len(self.range_m) == len(self.no_echo) <= bounds.MAX_READINGS:
            raise SweepError(
                f"{name} has {readings} readings: a sweep has {bounds.MAX_READINGS} at most; drop it", "readings"
            )
        for field in ("time_s", "x_m", "y_m", "heading_rad", "sigma_position_m", "sigma_heading_rad", "bearing_rad"):
            _check(name, field, getattr(self, field))
        _check(name, "beam_width_rad", self.beam_width_rad)
        _check(name, "range_m", self.range_m[~np.isnan(self.range_m)])
        if self.range_sigma_m is not None:
            _check(name, "range_sigma_m", self.range_sigma_m)
        _check(name, "face_offset_m", self.face_offset_m)
        _check(name, "face_offset_sigma_m", self.face_offset_sigma_m)

    @property
    def pose_is_unknown(self) -> bool:
        """Whether nobody knows where the unit was."""
        return self.sigma_position_m >= bounds.UNKNOWN_SIGMA_POSITION_M

    @property
    def direction_rad(self) -> np.ndarray:
        """Beam axes in the site's frame, (n,)."""
        return self.heading_rad + self.bearing_rad

    @cached_property  # a fit asks it of all sweeps of the site
    def step_rad(self) -> float:
        """From one bearing to the next, the median; a full turn where all are one."""
        return step_rad(self.bearing_rad)

    def echoes_m(self) -> np.ndarray:
        """Where the echoes would be, were they on the beams' axes, in the site's frame, (echoes, 2)."""
        heard = np.isfinite(self.range_m)
        direction = np.stack([np.cos(self.direction_rad), np.sin(self.direction_rad)], axis=1)
        return np.array([self.x_m, self.y_m]) + self.range_m[heard, None] * direction[heard]


def step_rad(bearing_rad: np.ndarray) -> float:
    """From one bearing (n,) of a sweep to the next, the median; a full turn where all are one."""
    steps_rad = np.diff(np.unique(bearing_rad))
    return max(float(np.median(steps_rad)), _LEAST_STEP_RAD) if len(steps_rad) else 2 * np.pi


_LEAST_STEP_RAD = 1e-3  # finer than any motor's


def identity_of(sweep: messages_pb2.Sweep) -> tuple[str, int]:
    """What a sweep is known by: its place in the gateway's log, or unit, boot and sequence if it was never in one."""
    if sweep.log_id:
        return sweep.log_id, sweep.log_sequence
    return f"{sweep.unit}/{sweep.boot}", sweep.sequence


def from_message(sweep: messages_pb2.Sweep, sensor: SensorConfig | None = None) -> SweepReadings:
    """The sweep's readings as arrays; ``sensor`` stands in for what the sweep does not say of its own.

    Raises SweepError where there is no pose or a number is one that no sweep has, FaultyUnitError where the gateway had
    found a fault, StuckSensorError where the sensor only repeats itself.
    """
    default, name = sensor or SensorConfig(), _name(identity_of(sweep), sweep.unit)
    if sweep.faults:
        why = faulty.reason(sweep)
        raise FaultyUnitError(
            f"{name}: its gateway had found the unit {why}; see what noctule units advises", f"unit {why}"
        )
    if not sweep.HasField("pose"):
        raise SweepError(f"{name} has no pose: give the unit a pose, a path or a pose key in the site file", "no pose")
    own = sweep.sensor if sweep.HasField("sensor") else messages_pb2.Sensor()
    bias_m = own.range_bias_m if own.HasField("range_bias_m") else default.range_bias_m
    celsius = sweep.air_temperature_c if sweep.HasField("air_temperature_c") else default.air_temperature_c
    sigma_bias_m = 0.0 if own.HasField("range_bias_m") else default.bias_sigma_m
    sigma_k = 0.0 if sweep.HasField("air_temperature_c") else default.temperature_sigma_k
    face_m, sigma_face_m = _face_offset_m(own, default)
    _check(name, "range_bias_m", bias_m)
    _check(name, "air_temperature_c", celsius)
    with np.errstate(over="ignore"):  # beyond all numbers is beyond the longest range
        told_m = _flights_s(sweep, name) * speed_of_sound_m_s(celsius) / 2 - bias_m + face_m
    usable = (told_m >= default.shortest_range_m) & (told_m <= default.longest_range_m)
    readings = SweepReadings(
        identity=identity_of(sweep),
        unit=sweep.unit,
        time_s=sweep.start.seconds + sweep.start.nanos * 1e-9,
        clock_epoch=sweep.clock_epoch,
        x_m=sweep.pose.x_m,
        y_m=sweep.pose.y_m,
        heading_rad=sweep.pose.heading_rad,
        sigma_position_m=sweep.pose.sigma_position_m,
        sigma_heading_rad=sweep.pose.sigma_heading_rad,
        bearing_rad=np.array([reading.bearing_rad for reading in sweep.readings], dtype=float),
        range_m=np.where(usable, told_m, np.nan),
        no_echo=np.array([heard_nothing(reading) for reading in sweep.readings], dtype=bool),
        beam_width_rad=own.beam_width_rad if own.HasField("beam_width_rad") else default.beam_width_rad,
        range_sigma_m=own.range_sigma_m if own.HasField("range_sigma_m") else default.range_sigma_m,
        sigma_bias_m=sigma_bias_m,
        face_offset_m=face_m,
        face_offset_sigma_m=sigma_face_m,
        sigma_scale=speed_of_sound_m_s(celsius + sigma_k) / speed_of_sound_m_s(celsius) - 1,
    )
    _check_not_stuck(name, readings, told_m)
    return readings


def _face_offset_m(own: messages_pb2.Sensor, default: SensorConfig) -> tuple[float, float]:
    """How far the sensor's face stands off the axis, and how well that is known.

    Where nobody says, a mean error that was measured counts from the axis: to a wall straight ahead it has the whole
    offset in it. Where nobody has measured anything, the offset is one of the things not known.
    """
    if own.HasField("face_offset_m"):
        return own.face_offset_m, own.face_offset_sigma_m
    if "face_offset_m" in default.model_fields_set or not default.bias_sigma_m or own.HasField("range_bias_m"):
        return default.face_offset_m, default.face_offset_sigma_m
    return default.face_offset_m, default.assumed_face_sigma_m


def _flights_s(sweep: messages_pb2.Sweep, name: str) -> np.ndarray:
    """Times of flight, (n,), NaN where there was no echo or none that a reflector can have made."""
    flights_s = np.full(len(sweep.readings), np.nan)
    for index, reading in enumerate(sweep.readings):
        if (told_s := flight_s(reading)) is not None:
            if not math.isfinite(told_s):
                raise SweepError(
                    f"{name}, reading {index}: time_of_flight_s is not finite; leave it out for no echo",
                    "time of flight",
                )
            flights_s[index] = told_s
    return flights_s


def _check_not_stuck(name: str, sweep: SweepReadings, told_m: np.ndarray) -> None:
    """Raise StuckSensorError where the ranges (n,), before any is left out as too short or too long, only repeat."""
    heard = np.isfinite(told_m)
    listened = int(heard.sum() + sweep.no_echo.sum())
    if repeated := repeated_ranges_m(sweep.bearing_rad[heard], told_m[heard], sweep.beam_width_rad, listened):
        ranges = ", ".join(f"{one_m:.3f} m" for one_m in repeated)
        raise StuckSensorError(
            f"{name}: its sensor repeats {ranges} at nearly all of {listened} bearings, as no room answers; "
            "check the sensor, its wiring and what hangs before it",
            "stuck sensor",
        )


def _check(name: str, field: str, values: np.ndarray | float) -> None:
    """Raise SweepError where a value of ``field`` of the sweep called ``name`` lies outside its bounds, or is NaN."""
    bound, values = _BOUNDS[field], np.asarray(values, dtype=float)
    outside = values[~((values >= bound.least) & (values <= bound.most))]
    if outside.size:
        raise SweepError(f"{name}: {field} {bound.fault(float(outside.flat[0]))}", field)


def _name(identity: tuple[str, int], unit: str) -> str:
    log_id, number = identity
    return f"sweep {number} of {log_id!r} (unit {unit!r})"
