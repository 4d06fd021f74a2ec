"""How the map looks in the viewer, on a dark background: readings and messages to entity paths and archetypes."""

import io
from collections.abc import Mapping, Sequence
from math import cos, sin

import numpy as np
import rerun as rr
from PIL import Image

from noctule import keys, poses, rerun_paths
from noctule.messages_pb2 import (
    CONTACT_KIND_CORNER,
    CONTACT_KIND_CYLINDER,
    CONTACT_KIND_UNSPECIFIED,
    CONTACT_KIND_WALL,
    Contour,
    Features,
    GridTile,
)
from noctule.rerun_together import Together
from noctule.unit_colours import Colour, unit_colour
from noctule_mapper.contour import touch_marks
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view.drawing import Entries
from noctule_mapper.rerun_view.errors import (
    ARROW_LENGTH_M,
    CONTOUR_ORDER,
    UNIT_ORDER,
    draw_object_errors,
    draw_poses,
)
from noctule_mapper.rerun_view.labels import labels
from noctule_mapper.rerun_view.sight import Sight

_WALL: Colour = (236, 240, 245)
_CYLINDER: Colour = (255, 140, 66)
_CORNER: Colour = (255, 214, 102)
_TOUCH: Colour = (205, 148, 255)
_FREE: Colour = (54, 78, 104)
_OCCUPIED: Colour = (120, 205, 190)
_KINDS = {
    CONTACT_KIND_UNSPECIFIED: (120, 128, 140),
    CONTACT_KIND_WALL: (150, 190, 220),
    CONTACT_KIND_CYLINDER: _CYLINDER,
    CONTACT_KIND_CORNER: _CORNER,
}
_LABELS = {"unit": _WALL, "wall": _WALL, "cylinder": _CYLINDER, "touch": _TOUCH}

_NO_ECHO_LENGTH_M = 0.25
_LOBE_LENGTH_M, _LOBE_POINTS = 0.5, 6
# What is drawn later lies on top.
_GRID_ORDER, _SWEEP_ORDER, _FEATURE_ORDER = -10.0, 10.0, 20.0
# Rerun draws one of several images of full opacity without its alpha: unknown cells would be black.
_GRID_OPACITY = 0.99
# Masses change by a few 255ths with every sweep; coarser levels make their images small.
_LEVEL = 16


def draw_frame() -> Entries:
    """What stands for good: the site's y axis points up, where Rerun's 2-D views have it down."""
    yield rerun_paths.WORLD, rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]])


def draw_sweep(readings: SweepReadings, trail_m: Sequence[tuple[float, float]]) -> Entries:
    """A unit's last sweep as rays, the unit itself, and the way it came, ``trail_m``, all in the site's frame."""
    here, colour = (readings.x_m, readings.y_m), unit_colour(readings.unit)
    trail = rr.LineStrips2D([trail_m], colors=[(*colour, 60)], radii=rr.Radius.ui_points(0.8), draw_order=_SWEEP_ORDER)
    yield rerun_paths.unit_trail(readings.unit), trail
    yield from _rays(readings, here, colour)
    yield from _unit(readings, here, colour)


def draw_contour(contour: Contour) -> Entries:
    """Walls as strong lines, corners as points, cylinders as circles, all with their errors, touches as short bars
    across the echo's direction, as long as their error, units with the errors of their poses. draw_labels() names them.
    """
    yield from _walls(contour)
    corners = rr.Points2D(
        [(corner.x_m, corner.y_m) for corner in contour.corners],
        colors=[_WALL],
        radii=rr.Radius.ui_points(5.0),
        draw_order=CONTOUR_ORDER,
    )
    yield rerun_paths.CORNERS, corners
    yield from _cylinders(contour)
    yield from _touches(contour)
    yield from draw_object_errors(contour)
    yield from draw_poses([pose for pose in (*contour.stops, *contour.poses) if poses.is_placed(pose)])


def draw_labels(contour: Contour, units_m: Mapping[str, tuple[float, float]]) -> Entries:
    """Lengths of walls, radii of cylinders, what touches may be, and the names of the units at ``units_m``, each in its
    unit's colour; one that several units share is white.
    """
    placed = labels(contour, units_m)
    names = rr.Points2D(
        [label.place_m for label in placed],
        colors=[unit_colour(label.text) if label.text in units_m else _LABELS[label.kind] for label in placed],
        radii=rr.Radius.ui_points(0.1),
        labels=[label.text for label in placed],
        show_labels=True,
        draw_order=UNIT_ORDER,
    )
    yield rerun_paths.LABELS, names


def draw_echoes(sweeps: Sequence[SweepReadings]) -> Entries:
    """All echoes of a survey as faint dots on their beams' axes, in the colours of their units."""
    echoes_m = [sweep.echoes_m() for sweep in sweeps]
    colours = [(*unit_colour(sweep.unit), 150) for sweep, ends_m in zip(sweeps, echoes_m, strict=True) for _ in ends_m]
    dots = rr.Points2D(
        np.concatenate([np.zeros((0, 2)), *echoes_m]),
        colors=colours,
        radii=rr.Radius.ui_points(2.0),
        draw_order=_SWEEP_ORDER,
    )
    yield rerun_paths.ECHOES, dots


def draw_features(features: Features) -> Entries:
    """Feature points, coloured by what they seem to lie on, larger where more reliable."""
    points = rr.Points2D(
        [(point.x_m, point.y_m) for point in features.points],
        colors=[_KINDS[point.kind] for point in features.points],
        radii=rr.Radius.ui_points([1.0 + 2.0 * point.reliability for point in features.points]),
        draw_order=_FEATURE_ORDER,
    )
    yield rerun_paths.FEATURES, points


def draw_tile(tile: GridTile, seen: Sight | None = None) -> Entries:
    """A tile of the reliability grid: free space lit faintly where it is ``seen``, occupied cells brightly, and unknown
    ones left dark.
    """
    path = rerun_paths.grid_tile(keys.tile_name(tile.tile_x, tile.tile_y))
    yield path, rr.Transform3D(translation=[tile.x_m, tile.y_m, 0.0], scale=tile.cell_m)
    image = rr.EncodedImage(
        contents=_png(tile, seen), media_type="image/png", opacity=_GRID_OPACITY, draw_order=_GRID_ORDER
    )
    yield path, image


def _rays(readings: SweepReadings, here: tuple[float, float], colour: Colour) -> Entries:
    direction = np.stack([np.cos(readings.direction_rad), np.sin(readings.direction_rad)], axis=1)
    heard = np.isfinite(readings.range_m)
    echoes_m = readings.echoes_m()
    silences_m = here + _NO_ECHO_LENGTH_M * direction[readings.no_echo & ~heard]
    rays = rr.LineStrips2D(
        [[here, end] for end in (*echoes_m, *silences_m)],
        colors=[(*colour, 150)] * len(echoes_m) + [(*colour, 40)] * len(silences_m),
        radii=rr.Radius.ui_points(0.6),
        draw_order=_SWEEP_ORDER,
    )
    ends = rr.Points2D(echoes_m, colors=[colour], radii=rr.Radius.ui_points(2.5), draw_order=_SWEEP_ORDER)
    yield rerun_paths.unit_rays(readings.unit), Together(rays, ends)


def _unit(readings: SweepReadings, here: tuple[float, float], colour: Colour) -> Entries:
    heading = rr.Arrows2D(
        vectors=[(ARROW_LENGTH_M * cos(readings.heading_rad), ARROW_LENGTH_M * sin(readings.heading_rad))],
        origins=[here],
        colors=[colour],
        radii=rr.Radius.ui_points(2.5),
        draw_order=UNIT_ORDER,
    )
    body = rr.Points2D(
        [here],
        colors=[colour],
        radii=rr.Radius.ui_points(6.0),
        draw_order=UNIT_ORDER,
    )
    lobe = rr.LineStrips2D(
        [_lobe_m(readings, here)],
        colors=[(*colour, 110)],
        radii=rr.Radius.ui_points(0.8),
        draw_order=UNIT_ORDER,
    )
    yield rerun_paths.unit_pose(readings.unit), Together(heading, body, lobe)


def _lobe_m(readings: SweepReadings, here: tuple[float, float]) -> np.ndarray:
    """The outline (points, 2) of the beam straight ahead: what the unit hears at one bearing."""
    across_rad = readings.heading_rad + readings.beam_width_rad * np.linspace(-0.5, 0.5, _LOBE_POINTS)
    rim_m = here + _LOBE_LENGTH_M * np.stack([np.cos(across_rad), np.sin(across_rad)], axis=1)
    return np.array([here, *rim_m, here])


def _walls(contour: Contour) -> Entries:
    ends_m = [((wall.start.x_m, wall.start.y_m), (wall.end.x_m, wall.end.y_m)) for wall in contour.walls]
    walls = rr.LineStrips2D(
        ends_m,
        colors=[_WALL],
        radii=rr.Radius.ui_points(3.0),
        draw_order=CONTOUR_ORDER,
    )
    yield rerun_paths.WALLS, walls


def _cylinders(contour: Contour) -> Entries:
    centres_m = [(cylinder.x_m, cylinder.y_m) for cylinder in contour.cylinders]
    radii_m = [cylinder.radius_m for cylinder in contour.cylinders]
    circles = rr.Ellipses2D(
        centers=centres_m,
        half_sizes=[(radius_m, radius_m) for radius_m in radii_m],
        colors=[_CYLINDER],
        line_radii=rr.Radius.ui_points(3.0),
        draw_order=CONTOUR_ORDER,
    )
    yield rerun_paths.CYLINDERS, circles
    centres = rr.Points2D(
        centres_m,
        colors=[_CYLINDER],
        radii=rr.Radius.ui_points(2.0),
        draw_order=CONTOUR_ORDER,
    )
    yield rerun_paths.CYLINDERS, centres


def _touches(contour: Contour) -> Entries:
    touches = rr.LineStrips2D(
        [touch_marks.bar_m(touch) for touch in contour.touches],
        colors=[_TOUCH],
        radii=rr.Radius.ui_points(2.0),
        draw_order=CONTOUR_ORDER,
    )
    yield rerun_paths.TOUCHES, touches


def _png(tile: GridTile, seen: Sight | None) -> bytes:
    """(rows, columns) masses to an RGBA image with row 0 first."""
    free, occupied = (
        np.frombuffer(masses, np.uint8).reshape(tile.rows, tile.columns) // _LEVEL * _LEVEL / 255.0
        for masses in (tile.free, tile.occupied)
    )
    if seen is not None:
        free = np.where(seen.cells(tile), free, 0.0)
    known = np.maximum(free + occupied, 1e-9)
    colour = (free[..., None] * _FREE + occupied[..., None] * _OCCUPIED) / known[..., None]
    alpha = 255.0 * np.clip(0.55 * free + occupied, 0.0, 1.0)
    rgba = np.dstack([colour, alpha]).astype(np.uint8)
    png = io.BytesIO()
    Image.fromarray(rgba).save(png, "PNG", compress_level=1)
    return png.getvalue()
