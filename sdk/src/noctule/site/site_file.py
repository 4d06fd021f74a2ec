"""Reads a site file."""

import re
from dataclasses import replace
from pathlib import Path
from urllib.parse import urlsplit

from noctule import keys, toml_file
from noctule.bounds import AIR_C, MAX_READINGS, UNIT_PAUSE_S, UNIT_PLAN, number
from noctule.errors import KeyFormatError, SiteFileError
from noctule.messages_pb2 import SweepPlan
from noctule.site.model import Sensor, Site, Unit
from noctule.site.pose_source import pose_source
from noctule.toml_table import Table, shown

PINGS = (1, 3, 5)  # of which there is a median
_MAX_SERIAL = 0xFFFFFFFE  # 0xFFFFFFFF is a unit that was flashed without one
_SCHEMES = ("socket", "rfc2217")


def load(path: Path) -> Site:
    """Read a site file.

    Raises SiteFileError with a line for each mistake: file, line, table and field, and what to do.
    """
    file = toml_file.read(path, SiteFileError)
    top = Table(path, "", file.entries, file.lines)
    sensor = _sensor(top.table("sensor"), Sensor())
    site = Site(
        name=_name(top, "site"),
        units=tuple(_unit(table, sensor) for table in top.tables("unit")),
        air_temperature_c=top.optional_number("air_temperature_c", AIR_C),
        clock=top.choice("clock", ("utc", "unit")),  # pyright: ignore[reportArgumentType]
    )
    top.end()
    top.refuse()
    _check_distinct(top, site.units)
    return site


def _name(table: Table, key: str) -> str:
    """Empty after a mistake."""
    value = table.text(key)
    try:
        if value == keys.ANY:
            raise KeyFormatError("'*' stands for all names and can't be one")
        return keys.name(value, "the name") if value else value
    except KeyFormatError as error:
        table.mistake(key, f"is wrong: {error}")
        return ""


def _unit(table: Table, default: Sensor) -> Unit:
    name = _name(table, "name")
    if name:
        table.name = f"[[unit]] {name!r}"
    sweep = table.table("sweep")
    unit = Unit(
        name=name,
        serial=table.integer("serial", 0, _MAX_SERIAL),
        address=_address(table),
        pose=pose_source(table),
        sensor=_sensor(table.table("sensor"), default),
        plan=_plan(sweep),
        start=sweep.flag("start", default=False),  # a motor turns by itself only where the file says so
        pause_s=sweep.optional_number("pause_s", UNIT_PAUSE_S) or 0.0,
        room=table.text("room") if table.has("room") else "",
    )
    sweep.end()
    table.end()
    return unit


def _sensor(table: Table, default: Sensor) -> Sensor:
    width_rad = table.optional_angle("beam_width_deg", number("Sensor", "beam_width_rad"))
    lengths_m = {field: table.optional_number(field, number("Sensor", field)) for field in _SENSOR_LENGTHS}
    offset_m, sigma_m = (lengths_m[field] for field in ("face_offset_m", "face_offset_sigma_m"))
    if sigma_m is not None and offset_m is None and default.face_offset_m is None:
        table.mistake("face_offset_sigma_m", "has no face_offset_m beside it: give that too")
    table.end()
    known = {"beam_width_rad": width_rad, **lengths_m}
    if offset_m is not None and sigma_m is None:
        default = replace(default, face_offset_sigma_m=None)  # the site's is of another offset
    return replace(default, **{field: value for field, value in known.items() if value is not None})


_SENSOR_LENGTHS = ("range_bias_m", "range_sigma_m", "face_offset_m", "face_offset_sigma_m")


def _address(unit: Table) -> str:
    address = unit.text("address")
    form = "give socket://HOST:PORT, rfc2217://HOST:PORT or a device's path such as /dev/ttyUSB0"
    scheme, found, _ = address.partition("://")
    if not found:
        if re.fullmatch(r"[^/]+:\d+", address):
            unit.mistake("address", f"is {shown(address)}: {form}")
        return address
    if scheme not in _SCHEMES:
        unit.mistake("address", f"is {shown(address)}: {scheme}:// is not known, {form}")
        return address
    try:
        parts = urlsplit(address)
        if not parts.hostname or not parts.port:
            raise ValueError("host and port must both be there, the port from 1 to 65535")
    except ValueError as error:
        unit.mistake("address", f"is {shown(address)}: {error}; {form}")
    return address


def _plan(sweep: Table) -> SweepPlan | None:
    plan = SweepPlan(
        first_bearing_rad=sweep.optional_angle("first_bearing_deg", UNIT_PLAN["first_bearing_rad"]),
        bearing_step_rad=sweep.optional_angle("bearing_step_deg", UNIT_PLAN["bearing_step_rad"]),
        count=sweep.integer("count", 1, MAX_READINGS) if sweep.has("count") else None,
        pings=_pings(sweep),
        **{
            field: sweep.optional_number(field, UNIT_PLAN[field])
            for field in ("ping_interval_s", "top_speed_half_steps_s", "ramp_s", "settle_s")
        },
    )
    return plan if plan.ListFields() else None


def _pings(sweep: Table) -> int | None:
    if not sweep.has("pings"):
        return None
    pings = sweep.integer("pings", PINGS[0], PINGS[-1])
    if pings not in PINGS:
        sweep.mistake("pings", f"is {pings}: give {', '.join(map(str, PINGS[:-1]))} or {PINGS[-1]}")
    return pings


def _check_distinct(top: Table, units: tuple[Unit, ...]) -> None:
    for field in ("name", "serial", "address"):
        first: dict[object, str] = {}
        for index, unit in enumerate(units):
            value = getattr(unit, field)
            if value in first:
                table = Table(top.file, f"[[unit]] {unit.name!r}", {}, top.lines, top.found, ("unit", index))
                table.mistake(field, f"{value!r} is also that of {first[value]!r}: change one")
            first.setdefault(value, unit.name)
    top.refuse()
