"""How well the map is known, drawn where it is: errors are shown as wide as two standard deviations to each side."""

from collections.abc import Iterator, Sequence
from math import cos, hypot, radians, sin

import numpy as np
import rerun as rr

from noctule import poses, rerun_paths, walls
from noctule.messages_pb2 import POSE_STATE_WRONG, Contour, UnitPose, Wall
from noctule.unit_colours import Colour, unit_colour
from noctule_mapper.rerun_view.drawing import Entries

ARROW_LENGTH_M = 0.2
# What is drawn later lies on top.
CONTOUR_ORDER, UNIT_ORDER = 30.0, 40.0
_ERROR_ORDER = 29.0  # an error that is smaller than the line of what it is about is not seen

_SHOWN_SIGMAS = 2.0  # of two coordinates: 86 % of such ellipses hold what they are about
_ELLIPSE_CORNERS = 32
_ALONG_A_WALL = np.linspace(0.0, 1.0, 9)
_LEAST_WALL_M = 0.01
_ERROR: tuple[int, int, int, int] = (255, 196, 120, 170)
_WRONG: Colour = (255, 77, 77)


def draw_object_errors(contour: Contour) -> Entries:
    """An ellipse about each corner and each cylinder's centre, and a line to each side of a wall: it narrows where the
    wall was heard, and opens towards ends that were not.
    """
    strips_m = [*_of_corners(contour), *_of_cylinders(contour)]
    strips_m += [strip_m for wall in contour.walls for strip_m in wall_band_m(wall)]
    errors = rr.LineStrips2D(strips_m, colors=[_ERROR], radii=rr.Radius.ui_points(1.0), draw_order=_ERROR_ORDER)
    yield rerun_paths.ERRORS, errors


def draw_poses(placed: Sequence[UnitPose]) -> Entries:
    """Each unit's error as an ellipse and a wedge about its heading; a wrong one is red, named and tied to where it was
    stated to be.
    """
    lines_m, colours = [], []
    for pose in placed:
        colour = _pose_colour(pose)
        strips_m = _of_pose(pose)
        if pose.state == POSE_STATE_WRONG:
            strips_m.append(np.array([(pose.stated.x_m, pose.stated.y_m), (pose.x_m, pose.y_m)]))
        lines_m += strips_m
        colours += [colour] * len(strips_m)
    errors = rr.LineStrips2D(lines_m, colors=colours, radii=rr.Radius.ui_points(1.2), draw_order=UNIT_ORDER)
    yield rerun_paths.POSES, errors
    wrong = [pose for pose in placed if pose.state == POSE_STATE_WRONG]
    names = rr.Points2D(
        [(pose.x_m, pose.y_m) for pose in wrong],
        colors=[_WRONG],
        radii=rr.Radius.ui_points(6.0),
        labels=[f"{pose.unit}: wrong pose" for pose in wrong],
        show_labels=True,
        draw_order=UNIT_ORDER,
    )
    yield rerun_paths.POSES, names


def wall_band_m(wall: Wall) -> list[np.ndarray]:
    """The two lines (points, 2) between which the wall lies; none where its error is not stated."""
    start, end = np.array([wall.start.x_m, wall.start.y_m]), np.array([wall.end.x_m, wall.end.y_m])
    if len(wall.covariance) != 4 or hypot(*(end - start)) < _LEAST_WALL_M:
        return []
    along_m = start + _ALONG_A_WALL[:, None] * (end - start)
    sigmas_m = [walls.sigma_m(wall, x_m, y_m) or 0.0 for x_m, y_m in along_m]
    off_m = _SHOWN_SIGMAS * np.array(sigmas_m)[:, None]
    normal = np.array([cos(wall.theta_rad), sin(wall.theta_rad)])
    return [along_m + off_m * normal, along_m - off_m * normal]


def _of_corners(contour: Contour) -> Iterator[np.ndarray]:
    for corner in contour.corners:
        if len(corner.covariance) == 4:
            yield _ellipse_m((corner.x_m, corner.y_m), np.reshape(corner.covariance, (2, 2)))


def _of_cylinders(contour: Contour) -> Iterator[np.ndarray]:
    for cylinder in contour.cylinders:
        if len(cylinder.covariance) == 9:
            yield _ellipse_m((cylinder.x_m, cylinder.y_m), np.reshape(cylinder.covariance, (3, 3))[:2, :2])


def _of_pose(pose: UnitPose) -> list[np.ndarray]:
    """The outline of the position's error (corners, 2), and the wedge in which the unit looks (3, 2)."""
    known = poses.sigmas(pose)
    if known is None:
        return []
    here = np.array([pose.x_m, pose.y_m])
    ellipse = _ellipse_m((pose.x_m, pose.y_m), np.reshape(pose.covariance, (3, 3))[:2, :2])
    off_rad = radians(min(_SHOWN_SIGMAS * known[1], 180.0))
    ends = [pose.heading_rad + off_rad, pose.heading_rad - off_rad]
    first, last = (here + ARROW_LENGTH_M * np.array([cos(end), sin(end)]) for end in ends)
    return [ellipse, np.array([first, here, last])]


def _ellipse_m(centre_m: tuple[float, float], spread: np.ndarray) -> np.ndarray:
    """The outline (corners, 2) of the error ``spread`` (2, 2) about ``centre_m``."""
    values, axes = np.linalg.eigh((spread + spread.T) / 2)
    turn_rad = np.linspace(0.0, 2 * np.pi, _ELLIPSE_CORNERS + 1)
    circle = np.stack([np.cos(turn_rad), np.sin(turn_rad)])
    return np.array(centre_m) + (_SHOWN_SIGMAS * axes * np.sqrt(np.maximum(values, 0.0)) @ circle).T


def _pose_colour(pose: UnitPose) -> Colour:
    return _WRONG if pose.state == POSE_STATE_WRONG else unit_colour(pose.unit)
