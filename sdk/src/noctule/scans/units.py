"""In which units the columns of a scanner's file are: as a person says, or as the file itself tells."""

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from noctule.errors import ScanError
from noctule.scans.cells import Figure, figure, unit_in
from noctule.scans.options import DEGREES, METRES, SECONDS, ScanOptions
from noctule.scans.rows import Row, Table, lookup


@dataclass(frozen=True)
class Units:
    """How many metres, degrees and seconds the figures of each column are."""

    range_m: float
    range_unit: str
    angle_deg: float
    time_s: float | None
    place_m: float


def units_of(file: Path, table: Table, options: ScanOptions) -> Units:
    """The units that the options, the columns' names or the figures tell. Raises ScanError where none of them does."""
    columns = options.columns
    ranges = _unit(table, columns.range, METRES, options.units)
    if ranges is None:
        median = _median(table.rows, columns.range)
        raise ScanError(
            file,
            f"does not say in which unit its ranges are (their median is {median:g}): give --units cm, mm, m, in or ft",
            column=columns.range,
        )
    times = _unit(table, columns.time, SECONDS, options.time_units) if columns.time else None
    if columns.time and times is None and _figures(table.rows[:1], columns.time):
        raise ScanError(
            file, "does not say in which unit its times are: give --time-units s, ms or us", column=columns.time
        )
    places = _unit(table, columns.x, METRES, options.place_units) if columns.x else None
    angles = _unit(table, columns.angle, DEGREES, options.angle_units) or "deg"
    return Units(METRES[ranges], ranges, DEGREES[angles], SECONDS[times] if times else None, METRES[places or ranges])


def _unit(table: Table, column: str, units: dict[str, float], stated: str | None) -> str | None:
    """The unit as stated, as in the column's name, or as written after its first figure."""
    if stated:
        return stated
    numbered = {str(number): name for number, name in enumerate(table.names, start=1)}
    if unit := unit_in(numbered.get(column, column), units):
        return unit
    first = next((found.unit for found in _figures(table.rows, column)), "")
    return first if first in units else None


def _figures(rows: Sequence[Row], column: str) -> list[Figure]:
    found = []
    for row in rows:
        with suppress(KeyError):
            found.append(figure(lookup(row.cells, column)))
    return [each for each in found if each is not None]


def _median(rows: Sequence[Row], column: str) -> float:
    values = sorted(each.value for each in _figures(rows, column))
    return values[len(values) // 2] if values else math.nan
