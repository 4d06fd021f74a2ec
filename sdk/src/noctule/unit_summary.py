"""All that is known of one unit, to be filed with it: its status, its settings, what its sweeps are like."""

from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from json import dumps, loads
from math import degrees
from statistics import median

from noctule import faults, survey
from noctule.air import speed_of_sound_m_s
from noctule.messages_pb2 import (
    READING_STATUS_NO_SENSOR,
    READING_STATUS_STUCK_HIGH,
    READING_STATUS_TOO_EARLY,
    Measurement,
    ReadingStatus,
    Sweep,
    UnitSettings,
    UnitStatus,
)

_ASSUMED_AIR_C = 20.0
_SAME_BEARING_DEG = 0.5
_FAILED = (READING_STATUS_TOO_EARLY, READING_STATUS_STUCK_HIGH, READING_STATUS_NO_SENSOR)

_Answer = tuple[float, int, float | None]
"""Bearing in degrees, status, range in metres."""


@dataclass(frozen=True)
class BearingStatistics:
    """What a bearing has answered in the sweeps looked at; ranges are from the sensor's face, in metres."""

    bearing_deg: float
    readings: int
    echoes: int
    median_m: float | None
    deviation_m: float | None  # median, from the median
    failed: dict[str, int]  # readings by status, but for echo and no echo


@dataclass(frozen=True)
class UnitSummary:
    """``settings`` is None where the unit could not be asked, which ``settings_error`` explains."""

    status: UnitStatus
    settings: UnitSettings | None
    settings_error: str
    sweeps: list[Sweep]
    measurements: list[Measurement]

    @property
    def bearings(self) -> list[BearingStatistics]:
        """By rising bearing."""
        return bearing_statistics(self.sweeps)

    @property
    def flagged(self) -> int:
        """Of the sweeps, those made while a fault was known."""
        return sum(bool(sweep.faults) for sweep in self.sweeps)

    def to_json(self) -> str:
        """One JSON object: {unit, status, settings, settings_error, measurements, sweeps, sweeps_flagged, bearings}."""
        whole = {
            "unit": self.status.unit,
            "status": loads(survey.to_json(self.status)),
            "settings": None if self.settings is None else loads(survey.to_json(self.settings)),
            "settings_error": self.settings_error,
            "measurements": [loads(survey.to_json(each)) for each in self.measurements],
            "sweeps": [sweep.log_sequence for sweep in self.sweeps],
            "sweeps_flagged": self.flagged,
            "bearings": [asdict(each) for each in self.bearings],
        }
        return dumps(whole, indent=2)

    def health_lines(self) -> Iterator[str]:
        """Each fault, or that there is none."""
        if not self.status.faults:
            yield "  its sweeps show nothing wrong"
        for fault in self.status.faults:
            yield f"  {faults.sentence(fault)}"

    def sweep_lines(self) -> Iterator[str]:
        """A table of the bearings."""
        if not self.sweeps:
            yield "  none in its log"
            return
        first, last = self.sweeps[0], self.sweeps[-1]
        made = f"{first.start.ToDatetime():%Y-%m-%d %H:%M:%S} to {last.start.ToDatetime():%Y-%m-%d %H:%M:%S} UTC"
        yield f"  {first.log_sequence} to {last.log_sequence} of its log, {made}; {self.flagged} made with a fault"
        yield "  bearing  readings  echoes  range     scatter   failed"
        for one in self.bearings:
            range_m = "" if one.median_m is None else f"{one.median_m:.3f} m"
            scatter = "" if one.deviation_m is None else f"{1000 * one.deviation_m:.1f} mm"
            failed = ", ".join(f"{count} {name}" for name, count in one.failed.items())
            counted = f"  {one.bearing_deg:7.1f}  {one.readings:8}  {one.echoes / one.readings:6.0%}"
            yield f"{counted}  {range_m:<8}  {scatter:<8}  {failed}".rstrip()


def bearing_statistics(sweeps: Iterable[Sweep]) -> list[BearingStatistics]:
    """Of all readings of the sweeps; bearings that differ by less than half a degree are one."""
    gathered: list[_Answer] = []
    for sweep in sweeps:
        air_c = sweep.air_temperature_c if sweep.HasField("air_temperature_c") else _ASSUMED_AIR_C
        for one in sweep.readings:
            range_m = one.time_of_flight_s * speed_of_sound_m_s(air_c) / 2 if one.HasField("time_of_flight_s") else None
            gathered.append((degrees(one.bearing_rad), one.status, range_m))
    gathered.sort(key=lambda each: each[0])
    result: list[BearingStatistics] = []
    group: list[_Answer] = []
    for each in gathered:
        if group and each[0] - group[0][0] > _SAME_BEARING_DEG:
            result.append(_statistics(group))
            group = []
        group.append(each)
    return [*result, _statistics(group)] if group else []


def _statistics(group: list[_Answer]) -> BearingStatistics:
    heard = [range_m for _, _, range_m in group if range_m is not None]
    middle = median(heard) if heard else None
    failed: dict[str, int] = {}
    for _, status, _ in group:
        if status in _FAILED:
            name = ReadingStatus.Name(status).removeprefix("READING_STATUS_").lower().replace("_", " ")
            failed[name] = failed.get(name, 0) + 1
    return BearingStatistics(
        bearing_deg=round(median(bearing for bearing, _, _ in group), 2),
        readings=len(group),
        echoes=len(heard),
        median_m=middle,
        deviation_m=None if middle is None else median(abs(one_m - middle) for one_m in heard),
        failed=failed,
    )
