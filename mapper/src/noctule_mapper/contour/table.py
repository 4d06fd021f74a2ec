"""A contour as tables for people to read: metres, and standard deviations in millimetres."""

from collections.abc import Sequence
from math import degrees, hypot, isqrt, nan, sqrt

from noctule import poses
from noctule.messages_pb2 import Contour, Corner, Cylinder, Touch, Wall

_WALL_HEAD = (
    "wall",
    "theta_deg",
    "rho_m",
    "±mm",
    "from_x_m",
    "from_y_m",
    "to_x_m",
    "to_y_m",
    "length_m",
    "readings",
    "chance",
)
_CORNER_HEAD = ("corner", "x_m", "y_m", "±mm", "walls")
_CYLINDER_HEAD = ("cylinder", "x_m", "y_m", "±mm", "radius_m", "±mm", "readings")
_TOUCH_HEAD = ("touch", "x_m", "y_m", "±mm", "unit", "readings", "wall", "corner", "cylinder")


def contour_table(contour: Contour) -> str:
    """A table of walls, one of corners, one of cylinders, and one of touches where there are any, what is numbered
    counting from 1; the units' poses where the contour has some, and its note.
    """
    walls = [_wall(number, wall) for number, wall in enumerate(contour.walls, 1)]
    corners = [_corner(number, corner) for number, corner in enumerate(contour.corners, 1)]
    cylinders = [_cylinder(number, cylinder) for number, cylinder in enumerate(contour.cylinders, 1)]
    touches = [_touch(number, touch) for number, touch in enumerate(contour.touches, 1)]
    tables = [(_WALL_HEAD, walls), (_CORNER_HEAD, corners), (_CYLINDER_HEAD, cylinders)]
    tables += [(_TOUCH_HEAD, touches)] if touches else []
    lines = [f"stop {number} of unit {pose.unit}: {poses.words(pose)}" for number, pose in enumerate(contour.stops, 1)]
    units = "\n".join([*lines, *(f"unit {pose.unit}: {poses.words(pose)}" for pose in contour.poses)])
    return "\n\n".join([*(_aligned([head, *rows]) for head, rows in tables), *filter(None, [units, contour.note])])


def _wall(number: int, wall: Wall) -> tuple[str, ...]:
    start, end = wall.start, wall.end
    ends_m = (start.x_m, start.y_m, end.x_m, end.y_m, hypot(end.x_m - start.x_m, end.y_m - start.y_m))
    theta, rho = f"{degrees(wall.theta_rad):.2f}", f"{wall.rho_m:.4f}"
    return (
        str(number),
        theta,
        rho,
        _sigma_mm(wall.covariance, 1),
        *(f"{each_m:.4f}" for each_m in ends_m),
        str(wall.readings),
        f"{wall.chance:.3f}" if wall.HasField("chance") else "1",
    )


def _corner(number: int, corner: Corner) -> tuple[str, ...]:
    walls = "-".join(str(wall + 1) for wall in corner.walls)
    return str(number), f"{corner.x_m:.4f}", f"{corner.y_m:.4f}", _sigma_mm(corner.covariance, 0, 1), walls


def _cylinder(number: int, cylinder: Cylinder) -> tuple[str, ...]:
    return (
        str(number),
        f"{cylinder.x_m:.4f}",
        f"{cylinder.y_m:.4f}",
        _sigma_mm(cylinder.covariance, 0, 1),
        f"{cylinder.radius_m:.4f}",
        _sigma_mm(cylinder.covariance, 2),
        str(cylinder.readings),
    )


def _touch(number: int, touch: Touch) -> tuple[str, ...]:
    chances = (touch.chance_wall, touch.chance_corner, touch.chance_cylinder)
    return (
        str(number),
        f"{touch.x_m:.4f}",
        f"{touch.y_m:.4f}",
        _sigma_mm(touch.covariance, 0, 1),
        touch.unit,
        str(touch.readings),
        *(f"{chance:.2f}" for chance in chances),
    )


def _sigma_mm(covariance: Sequence[float], *indices: int) -> str:
    """Root of the summed variances of the fields at ``indices`` of a row-major covariance in metres."""
    side = isqrt(len(covariance))
    variance = sum(covariance[index * side + index] for index in indices) if side else nan
    return f"{1e3 * sqrt(variance):.1f}"


def _aligned(rows: Sequence[tuple[str, ...]]) -> str:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)) for row in rows)
