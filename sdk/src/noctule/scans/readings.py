"""The rows of a scanner's file as readings: degrees, metres and seconds, or the cell that is no such thing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from noctule import bounds
from noctule.air import speed_of_sound_m_s
from noctule.errors import ScanError
from noctule.scans import cells as cell_text
from noctule.scans.lines import Line
from noctule.scans.options import DEGREES, METRES, SECONDS, ScanOptions
from noctule.scans.rows import Cells, Row, Table, lookup
from noctule.scans.units import Units

_FLIGHT_S = bounds.number("Reading", "time_of_flight_s")
_BEARING_DEG = bounds.Number(-360, 360, "degrees", "one turn from the forward direction")
_PLACE_M = bounds.number("Pose", "x_m")
_HEADING_DEG = bounds.Number(-36_000, 36_000, "degrees")
_TIME_S = bounds.number("Timestamp", "seconds")
_TO_SKIP = "or leave such lines out with --skip-bad-lines"


@dataclass(frozen=True)
class Place:
    """Where the scanner stood, as the columns say."""

    x_m: float
    y_m: float
    heading_rad: float | None  # None: the file has no column of headings


@dataclass(frozen=True)
class ScanReading:
    """One reading: ``angle_deg`` and ``written`` as the file has them, ``flight_s`` None where nothing was heard."""

    angle_deg: float
    written: float | None
    flight_s: float | None
    time_s: float | None
    sweep: str | None
    place: Place | None


def is_reading(row: Cells, options: ScanOptions) -> bool:
    """Whether a row holds a figure for an angle, and for a range a figure or what stands for none."""
    try:
        angle, distance = lookup(row, options.columns.angle), lookup(row, options.columns.range)
    except KeyError:
        return False
    heard = cell_text.figure(distance) is not None or cell_text.word(distance) in map(cell_text.word, options.no_echo)
    return cell_text.figure(angle) is not None and heard


def readings(file: Path, table: Table, units: Units, options: ScanOptions) -> tuple[list[ScanReading], list[Line]]:
    """The readings in their order, and the lines that were left out: a cut last one, and bad ones if that was asked
    for. Raises ScanError at a cell that is not what its column holds, or beyond what a survey may hold.
    """
    found: list[ScanReading] = []
    left_out: list[Line] = []
    for row in table.rows:
        try:
            found.append(_reading(file, row, units, options))
        except ScanError:
            if not (row.line.is_cut or options.skip_bad_lines):
                raise
            left_out.append(row.line)
    if not found:
        raise ScanError(file, "holds no reading that can be used: correct the columns, or the file")
    return found, left_out


def _reading(file: Path, row: Row, units: Units, options: ScanOptions) -> ScanReading:
    columns = options.columns
    angle_deg = _number(file, row, columns.angle, units.angle_deg, DEGREES)
    _check(file, row, columns.angle, angle_deg - options.forward_deg, _BEARING_DEG)
    written, flight_s = _range(file, row, units, options)
    return ScanReading(
        angle_deg,
        written,
        flight_s,
        _time(file, row, columns.time, units.time_s) if columns.time else None,
        cell_text.word(_cell(file, row, columns.sweep)) if columns.sweep else None,
        _place(file, row, units, options) if columns.x and columns.y else None,
    )


def _range(file: Path, row: Row, units: Units, options: ScanOptions) -> tuple[float | None, float | None]:
    column = options.columns.range
    cell = _cell(file, row, column)
    found = cell_text.figure(cell)
    if _means_no_echo(cell, options.no_echo):
        return (found.value if found else None), None
    if found is None:
        means = cell_text.word(cell)
        problem = "is empty" if means == cell_text.EMPTY else f"is {cell!r}, which is no figure"
        advice = f"give --no-echo {means} if the scanner writes it where it heard nothing, {_TO_SKIP}"
        raise ScanError(file, f"{problem}: {advice}", row.line.place, column, cell)
    if options.no_echo_above is not None and found.value > options.no_echo_above:
        return found.value, None
    range_m = _number(file, row, column, units.range_m, METRES)
    speed_m_s = options.speed_of_sound_m_s or speed_of_sound_m_s(options.air_temperature_c)
    flight_s = 2 * range_m / speed_m_s
    if not _FLIGHT_S.least <= flight_s <= _FLIGHT_S.most:
        most = _FLIGHT_S.most * speed_m_s / 2 / units.range_m
        advice = f"give 0 to {most:.6g} {units.range_unit}, or name it with --no-echo or --no-echo-above"
        raise ScanError(file, f"is {cell!r}: {advice}, {_TO_SKIP}", row.line.place, column, cell)
    return found.value, flight_s


def _means_no_echo(cell: object, no_echo: Sequence[str]) -> bool:
    """Whether a range is one of the values that stand for nothing heard, as a number or as a word."""
    found = cell_text.figure(cell)
    for value in no_echo:
        named = cell_text.figure(value)
        if found.value == named.value if found and named else cell_text.word(cell) == cell_text.word(value):
            return True
    return False


def _place(file: Path, row: Row, units: Units, options: ScanOptions) -> Place:
    columns = options.columns
    assert columns.x and columns.y
    x_m, y_m = (_number(file, row, column, units.place_m, METRES) for column in (columns.x, columns.y))
    _check(file, row, columns.x, x_m, _PLACE_M)
    _check(file, row, columns.y, y_m, _PLACE_M)
    if columns.heading is None:
        return Place(x_m, y_m, None)
    heading_deg = _number(file, row, columns.heading, units.angle_deg, DEGREES)
    _check(file, row, columns.heading, heading_deg, _HEADING_DEG)
    return Place(x_m, y_m, math.radians(heading_deg))


def _time(file: Path, row: Row, column: str, seconds: float | None) -> float:
    cell = _cell(file, row, column)
    if seconds is not None:
        time_s = _number(file, row, column, seconds, SECONDS)
    else:
        try:
            time_s = datetime.fromisoformat(str(cell).strip()).timestamp()
        except (ValueError, OverflowError, OSError) as error:
            advice = "give a number, or a date and time as 2024-05-01T12:30:00Z"
            raise ScanError(file, f"is {cell!r}: {advice}, {_TO_SKIP}", row.line.place, column, cell) from error
    _check(file, row, column, time_s, _TIME_S)
    return time_s


def _check(file: Path, row: Row, column: str, value: float, bound: bounds.Number) -> None:
    if not bound.least <= value <= bound.most:
        cell = _cell(file, row, column)
        raise ScanError(file, f"is {cell!r}: {bound.allowed()}, {_TO_SKIP}", row.line.place, column, cell)


def _number(file: Path, row: Row, column: str, scale: float, units: dict[str, float]) -> float:
    """The figure in a cell, times ``scale``; a unit written after it must be the column's."""
    cell = _cell(file, row, column)
    found = cell_text.figure(cell)
    if found is None or not math.isfinite(found.value):
        problem = "is empty" if cell_text.word(cell) == cell_text.EMPTY else f"is {cell!r}, which is no figure"
        raise ScanError(file, f"{problem}: correct the line, {_TO_SKIP}", row.line.place, column, cell)
    if found.unit and units.get(found.unit) != scale:
        problem = f"is {cell!r}, but the column's figures are read in another unit: correct the unit in the command"
        raise ScanError(file, problem, row.line.place, column, cell)
    return found.value * scale


def _cell(file: Path, row: Row, column: str) -> object:
    try:
        return lookup(row.cells, column)
    except KeyError as error:
        has = ", ".join(name for name in row.cells if not name.isdigit()) or f"{len(row.cells)}"
        problem = f"is not there (the line has the columns {has}): correct the line or the column, {_TO_SKIP}"
        raise ScanError(file, problem, row.line.place, column) from error
