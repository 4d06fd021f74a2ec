"""The site file: which units a site has, how each is reached, where it is, and what is known of its sensor.

Its quantities have the bounds of the messages that they go into.
"""

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal
from urllib.parse import urlsplit

from noctule import keys, messages_pb2, toml_file
from noctule.bounds import (
    AIR_C,
    MAX_READINGS,
    UNIT_PAUSE_S,
    UNIT_PLAN,
    UNKNOWN_SIGMA_POSITION_M,
    WRITTEN_HEADING_RAD,
    Number,
    number,
)
from noctule.errors import KeyFormatError, SiteFileError
from noctule.messages_pb2 import SweepPlan
from noctule.survey_path import walk
from noctule.toml_table import Table

MAX_WAYPOINTS = 0xFFFF  # a unit counts them in 16 bits, and 0xFFFF means none
PINGS = (1, 3, 5)  # of which there is a median
MAX_SERIAL = 0xFFFFFFFE  # 0xFFFFFFFF is a unit that was flashed without one
SCHEMES = ("socket", "rfc2217")
# What a tape measure and a look along the wall are good to (1 to 5 cm, 1 to 5 degrees): the error of a fixed pose that
# states none.
TAPE_POSITION_M, TAPE_HEADING_RAD = 0.03, math.radians(3)

_X_M, _Y_M = number("Pose", "x_m"), number("Pose", "y_m")
_SPACING_M = Number(1e-3, 1e4, "m", "in metres")


@dataclass(frozen=True)
class Pose2:
    """A place and heading in the site's frame, with standard deviations (position: along each axis)."""

    x_m: float
    y_m: float
    heading_rad: float
    sigma_position_m: float = 0.0
    sigma_heading_rad: float = 0.0

    def message(self) -> messages_pb2.Pose:
        """The pose as it stands in a Sweep."""
        return messages_pb2.Pose(
            x_m=self.x_m,
            y_m=self.y_m,
            heading_rad=self.heading_rad,
            sigma_position_m=self.sigma_position_m,
            sigma_heading_rad=self.sigma_heading_rad,
        )


@dataclass(frozen=True)
class FixedPose:
    """The unit stays where it is."""

    pose: Pose2


@dataclass(frozen=True)
class UnknownPose:
    """The unit stays where it is, and the mapper is to find out where that is."""

    def message(self) -> messages_pb2.Pose:
        """The unknown pose as it stands in a Sweep."""
        return Pose2(0.0, 0.0, 0.0, UNKNOWN_SIGMA_POSITION_M, math.pi).message()


@dataclass(frozen=True)
class WaypointPath:
    """The unit is carried along a path; the waypoint number that it reports indexes ``poses``."""

    poses: tuple[Pose2, ...]


@dataclass(frozen=True)
class PoseKey:
    """Whoever tracks the unit publishes its pose on the unit's pose key."""


PoseSource = FixedPose | UnknownPose | WaypointPath | PoseKey


@dataclass(frozen=True)
class Sensor:
    """What is known of a range sensor; None is not known. ``range_bias_m`` is the mean of measured minus true range.

    ``face_offset_m`` is from the axis about which the unit turns to the sensor's face. Where it is given the true range
    counts from the face, otherwise from the axis.
    """

    beam_width_rad: float | None = None
    range_bias_m: float | None = None
    range_sigma_m: float | None = None
    face_offset_m: float | None = None
    face_offset_sigma_m: float | None = None

    def message(self) -> messages_pb2.Sensor:
        """The sensor as it stands in a Sweep."""
        return messages_pb2.Sensor(
            beam_width_rad=self.beam_width_rad,
            range_bias_m=self.range_bias_m,
            range_sigma_m=self.range_sigma_m,
            face_offset_m=self.face_offset_m,
            face_offset_sigma_m=self.face_offset_sigma_m,
        )


@dataclass(frozen=True)
class Unit:
    """One unit: ``serial`` is what its HELLO must show, ``plan`` is None where the unit's own is to stand."""

    name: str
    serial: int
    address: str
    pose: PoseSource
    sensor: Sensor
    plan: SweepPlan | None
    start: bool
    pause_s: float
    room: str = ""  # where it is named, units of other named rooms don't hear it


@dataclass(frozen=True)
class Site:
    """One frame of coordinates and its units; ``clock`` is "unit" where units' time runs at another speed than UTC."""

    name: str
    units: tuple[Unit, ...]
    air_temperature_c: float | None
    clock: Literal["utc", "unit"]

    def unit(self, name: str) -> Unit:
        """The unit of that name; raises SiteFileError if there is none."""
        for unit in self.units:
            if unit.name == name:
                return unit
        known = ", ".join(unit.name for unit in self.units)
        raise SiteFileError(f"site {self.name!r} has no unit {name!r}: it has {known}")


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
        return keys.name(value, "it") if value else value
    except KeyFormatError as error:
        table.mistake(key, f"is {value!r}: {error}")
        return ""


def _unit(table: Table, default: Sensor) -> Unit:
    name = _name(table, "name")
    if name:
        table.name = f"[[unit]] {name!r}"
    sweep = table.table("sweep")
    unit = Unit(
        name=name,
        serial=table.integer("serial", 0, MAX_SERIAL),
        address=_address(table),
        pose=_pose_source(table),
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
            unit.mistake("address", f"is {address!r}: {form}")
        return address
    if scheme not in SCHEMES:
        unit.mistake("address", f"is {address!r}: {scheme}:// is not known, {form}")
        return address
    try:
        parts = urlsplit(address)
        if not parts.hostname or not parts.port:
            raise ValueError("host and port must both be there, the port from 1 to 65535")
    except ValueError as error:
        unit.mistake("address", f"is {address!r}: {error}; {form}")
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


def _pose_source(unit: Table) -> PoseSource:
    if unit.has("path") == unit.has("pose"):
        form = 'pose = { ... }, pose = "unknown", pose = "key" or path = { ... }'
        unit.mistake("pose", f"or path, one of the two, must say where the unit is: {form}{unit.hint('pose', 'path')}")
        unit.has("pose_sigma")  # which is not wrong by itself
        return UnknownPose()
    written = unit.entries.get("pose")
    if written == "key":
        return PoseKey()
    if written == "unknown":
        return UnknownPose()
    if isinstance(written, str):
        unit.mistake("pose", f'is {written!r}: make it a table, pose = {{ ... }}, or give "unknown" or "key"')
        unit.has("pose_sigma")
        return UnknownPose()
    if unit.has("path"):
        sigma_m, sigma_rad = _sigmas(unit.table("pose_sigma"), "position_m", "heading_deg")
        places = _path(unit.table("path"))
        return WaypointPath(tuple(Pose2(x, y, heading, sigma_m or 0.0, sigma_rad or 0.0) for x, y, heading in places))
    return FixedPose(_fixed_pose(unit))


def _fixed_pose(unit: Table) -> Pose2:
    """The pose of a unit that stays; an error that it doesn't state is a tape measure's."""
    table = unit.table("pose")
    x_m, y_m = table.number("x_m", _X_M), table.number("y_m", _Y_M)
    heading_rad = table.angle("heading_deg", WRITTEN_HEADING_RAD)
    sigma_m, sigma_rad = _sigmas(table, "sigma_position_m", "sigma_heading_deg")
    if unit.has("pose_sigma"):
        if sigma_m is not None or sigma_rad is not None:
            unit.mistake("pose_sigma", "says what pose says too (sigma_position_m, sigma_heading_deg): remove it")
        sigma_m, sigma_rad = _sigmas(unit.table("pose_sigma"), "position_m", "heading_deg")
    return Pose2(
        x_m,
        y_m,
        heading_rad,
        TAPE_POSITION_M if sigma_m is None else sigma_m,
        TAPE_HEADING_RAD if sigma_rad is None else sigma_rad,
    )


def _sigmas(table: Table, position: str, heading: str) -> tuple[float | None, float | None]:
    """The errors, metres and radians, that ``table`` states, None where it leaves one out; it holds no more fields."""
    sigma_m = table.optional_number(position, number("Pose", "sigma_position_m"))
    sigma_rad = table.optional_angle(heading, number("Pose", "sigma_heading_rad"))
    table.end()
    return sigma_m, sigma_rad


def _path(path: Table) -> list[tuple[float, float, float]]:
    if path.has("waypoints") == path.has("corners_m"):
        path.asked |= {"closed", "spacing_m"}  # these are not wrong by themselves
        hint = path.hint("corners_m", "waypoints")
        path.mistake("corners_m", f"or waypoints, one of the two, must give the path{hint}")
        places = []
    elif path.has("waypoints"):
        columns = {"x_m": _X_M, "y_m": _Y_M, "heading_deg": WRITTEN_HEADING_RAD}
        places = [(x_m, y_m, heading_rad) for x_m, y_m, heading_rad in path.rows("waypoints", columns, least=1)]
    else:
        places = _walked(path)
    path.end()
    return places


def _walked(path: Table) -> list[tuple[float, float, float]]:
    corners_m = [(x_m, y_m) for x_m, y_m in path.rows("corners_m", {"x_m": _X_M, "y_m": _Y_M}, least=2)]
    closed = path.flag("closed", default=False)
    spacing_m = path.number("spacing_m", _SPACING_M)
    if not path.sound():
        return []
    following = [*corners_m[1:], corners_m[0]] if closed else corners_m[1:]
    for index, (corner, after) in enumerate(zip(corners_m, following, strict=False)):
        if corner == after:
            path.mistake(f"corners_m[{index}]", "is the same place as the corner after it: remove one")
    length_m = math.fsum(map(math.dist, corners_m, following))
    if length_m / spacing_m + len(corners_m) > MAX_WAYPOINTS:
        path.mistake(
            "spacing_m", f"is {spacing_m}: make it larger, a unit counts {MAX_WAYPOINTS} waypoints and no more"
        )
    return walk(corners_m, spacing_m, closed) if path.sound() else []


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
