"""What every export draws of a contour: its outlines, and polygons in place of circles."""

import numpy as np

from noctule.messages_pb2 import Contour
from noctule_mapper.contour.outline import Outline, outlines


def contour_outlines(contour: Contour) -> list[Outline]:
    """The walls that meet, as rings and open chains. Raises OutlineError where corners and walls don't go together."""
    walls = [((wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m)) for wall in contour.walls]
    corners = [
        (corner.x_m, corner.y_m, (corner.walls[0], corner.walls[1]))
        for corner in contour.corners
        if len(corner.walls) == 2
    ]
    return outlines(walls, corners)


def rings(contour: Contour) -> list[Outline]:
    """The outlines that enclose something."""
    return [outline for outline in contour_outlines(contour) if outline.closed and len(outline.points) >= 3]


def signed_area_m2(points: np.ndarray) -> float:
    """Area within ``points`` (k, 2), positive where they go round anticlockwise, as the inside of a room does."""
    x_m, y_m = points.T
    return float((x_m * np.roll(y_m, -1) - np.roll(x_m, -1) * y_m).sum()) / 2


def circle_points(x_m: float, y_m: float, radius_m: float, corners: int) -> np.ndarray:
    """Points on a circle, anticlockwise, (corners, 2)."""
    turn_rad = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    return np.stack([x_m + radius_m * np.cos(turn_rad), y_m + radius_m * np.sin(turn_rad)], axis=1)
