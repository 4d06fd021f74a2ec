"""Reads from a unit's table of a site file where the unit is: a pose, a path, or who finds out."""

import math

from noctule.bounds import WRITTEN_HEADING_RAD, Number, number
from noctule.site.model import FixedPose, Pose2, PoseKey, PoseSource, UnknownPose, WaypointPath
from noctule.survey_path import walk
from noctule.toml_table import Table, shown

_MAX_WAYPOINTS = 0xFFFF  # a unit counts them in 16 bits, and 0xFFFF means none
# What a tape measure and a look along the wall are good to (1 to 5 cm, 1 to 5 degrees): the error of a fixed pose that
# states none.
_TAPE_POSITION_M, _TAPE_HEADING_RAD = 0.03, math.radians(3)

_X_M, _Y_M = number("Pose", "x_m"), number("Pose", "y_m")
_SPACING_M = Number(1e-3, 1e4, "m", "in metres")


def pose_source(unit: Table) -> PoseSource:
    """Where the unit of the table is; UnknownPose after a mistake."""
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
        unit.mistake("pose", f'is {shown(written)}: make it a table, pose = {{ ... }}, or give "unknown" or "key"')
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
        _TAPE_POSITION_M if sigma_m is None else sigma_m,
        _TAPE_HEADING_RAD if sigma_rad is None else sigma_rad,
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
    if length_m / spacing_m + len(corners_m) > _MAX_WAYPOINTS:
        path.mistake(
            "spacing_m", f"is {spacing_m}: make it larger, a unit counts {_MAX_WAYPOINTS} waypoints and no more"
        )
    return walk(corners_m, spacing_m, closed) if path.sound() else []
