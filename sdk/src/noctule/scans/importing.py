"""A scanner's own file in, the sweeps of a survey out: what ``noctule import`` does."""

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from noctule.messages_pb2 import READING_STATUS_ECHO, READING_STATUS_NO_ECHO, Pose, Reading, Sweep
from noctule.scans.hints import hints
from noctule.scans.lines import Line, lines
from noctule.scans.options import ScanOptions
from noctule.scans.passes import passes, sweeps_of
from noctule.scans.readings import Place, ScanReading, is_reading, readings
from noctule.scans.rows import table
from noctule.scans.units import units_of
from noctule.site import Pose2

_ABSOLUTE_FROM_S = 1e9  # 2001: a count of seconds below it is of the scanner's own clock
_LOGGER_ERROR_S = 1.0  # of the stamps that a person's program writes beside its readings
_SHOWN = 60  # characters of a line


@dataclass(frozen=True)
class ImportedScan:
    """A scan as a survey: ``notes`` say what was left out or looks wrong, each in a sentence."""

    sweeps: list[Sweep]
    passes: int
    places: int
    readings: int
    echoes: int
    notes: list[str]


def import_scan(file: Path, options: ScanOptions) -> ImportedScan:
    """The sweeps in a scanner's ``file``. Raises ScanError, which names file, line, column and value."""
    content = lines(file)
    rows = table(file, content, options.columns.wanted().values(), lambda cells: is_reading(cells, options))
    units = units_of(file, rows, options)
    found, left_out = readings(file, rows, units, options)
    made = passes(found)
    pose = _poses(options)
    log_id = _log_id(file, options)
    sweeps: list[Sweep] = []
    for part in (part for one_pass in made for part in sweeps_of(one_pass)):
        sweeps.append(_sweep(part, len(sweeps) + 1, log_id, pose(part[0].place), options))
    return ImportedScan(
        sweeps,
        passes=len(made),
        places=len({reading.place for reading in found}),
        readings=len(found),
        echoes=sum(reading.flight_s is not None for reading in found),
        notes=[*_left_out(rows.preamble, left_out), *hints(found, units)],
    )


def _sweep(part: Sequence[ScanReading], number: int, log_id: str, pose: Pose, options: ScanOptions) -> Sweep:
    """One sweep. Where the file has no times, or those of the scanner's own clock, nothing says when it began: then
    it has no start.
    """
    sweep = Sweep(
        site=options.site,
        unit=options.unit,
        log_id=log_id,
        log_sequence=number,
        sequence=number,
        pose=pose,
        air_temperature_c=options.air_temperature_c,
    )
    start_s = part[0].time_s
    if start_s is not None and start_s >= _ABSOLUTE_FROM_S:
        sweep.start.FromNanoseconds(round(start_s * 1e9))
        sweep.clock_error_s = _LOGGER_ERROR_S
    sense = -1 if options.clockwise else 1
    for reading in part:
        sweep.readings.append(
            Reading(
                bearing_rad=math.radians(sense * (reading.angle_deg - options.forward_deg)),
                time_offset_s=0.0 if start_s is None or reading.time_s is None else reading.time_s - start_s,
                time_of_flight_s=reading.flight_s,
                status=READING_STATUS_NO_ECHO if reading.flight_s is None else READING_STATUS_ECHO,
            )
        )
    return sweep


def _poses(options: ScanOptions) -> Callable[[Place | None], Pose]:
    """Where the scanner stood. Its own place and forward direction are the frame, and exact, where nobody says more."""
    stated = options.pose
    sigmas = (options.sigma_position_m, math.radians(options.sigma_heading_deg))
    heading_rad = stated.heading_rad if stated else 0.0

    def pose(place: Place | None) -> Pose:
        if place is not None:
            own_rad = heading_rad if place.heading_rad is None else place.heading_rad
            return Pose2(place.x_m, place.y_m, own_rad, *sigmas).message()
        if stated is None:
            return Pose2(0.0, 0.0, 0.0).message()
        return Pose2(stated.x_m, stated.y_m, stated.heading_rad, *sigmas).message()

    return pose


def _log_id(file: Path, options: ScanOptions) -> str:
    """Of the file's content and the unit: the same import has it again, another file has another."""
    digest = hashlib.sha256(file.read_bytes() + options.unit.encode())
    return f"import-{digest.hexdigest()[:24]}"


def _left_out(preamble: Sequence[Line], bad: Sequence[Line]) -> list[str]:
    return [
        f"{_named(some)} left out, {why}: {some[0].text.strip()[:_SHOWN]!r}"
        for some, why in ((preamble, "before the first reading"), (bad, "no reading"))
        if some
    ]


def _named(some: Sequence[Line]) -> str:
    if len(some) == 1:
        return f"{some[0].place} was"
    return f"{len(some)} lines ({', '.join(line.place for line in some[:3])}{', ...' if some[3:] else ''}) were"
