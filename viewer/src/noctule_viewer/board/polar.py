"""A unit's last sweep as the unit sees it: straight ahead is up, circles are ranges, an echo is an arc of its beam.

The outermost circle has the radius 1 whatever its range, so that one layout holds every range.
"""

from collections.abc import Sequence
from math import ceil, cos, degrees, radians, sin

import numpy as np
import rerun as rr

from noctule import rerun_paths
from noctule.rerun_together import Together
from noctule.unit_colours import unit_colour
from noctule_viewer.board import bearings
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.heard_sweeps import HeardSweep

EDGE, LOWER_EDGE = 1.2, 1.35  # of the view, with room for the bearings' labels, each of which hangs below its place
SILENT, FAULTY = (96, 108, 126), (235, 64, 64)
_RING, _LABEL, _LOBE = (52, 62, 78), (140, 150, 166), (90, 104, 128)
_RING_STEPS_M = (0.1, 0.25, 0.5, 1.0, 2.0, 5.0)
_MOST_RINGS = 5
_RING_LABELS_AT_RAD = radians(-15)  # between two of the bearings' lines
_LABELLED_RAD = [radians(turned) for turned in range(-180, 180, 45)]
_ARC_POINTS = 6
_NEARLY_ALL_PERCENT = 97.0


def outermost_m(sweeps: Sequence[HeardSweep]) -> float:
    """The range of the outermost circle: a whole number of steps, beyond the farthest echo of the last of ``sweeps``
    and nearly all echoes of the others, of which a few may be false.
    """
    heard_m = np.concatenate([each.range_m for each in sweeps])
    last_m = sweeps[-1].range_m
    farthest_m = max(
        float(np.nanpercentile(heard_m, _NEARLY_ALL_PERCENT)) if np.isfinite(heard_m).any() else 1.0,
        float(np.nanmax(last_m)) if np.isfinite(last_m).any() else 0.0,
    )
    step_m = _step_m(farthest_m)
    return step_m * ceil(farthest_m / step_m)


def draw_rings(unit: str, outermost_m: float, beam_width_rad: float) -> Entries:
    """The circles with their ranges, the bearings, and the beam's width about straight ahead."""
    step_m = _step_m(outermost_m)
    ranges_m = [step_m * number for number in range(1, round(outermost_m / step_m) + 1)]
    circle_rad = np.linspace(0.0, 2 * np.pi, 73)
    strips = [_places(circle_rad, np.full(73, range_m / outermost_m)) for range_m in ranges_m]
    strips += [_places(np.full(2, turned_rad), np.array([0.0, 1.0])) for turned_rad in _LABELLED_RAD]
    colours = [_RING] * len(strips)
    half_rad = beam_width_rad / 2
    strips.append(_places(np.array([half_rad, 0.0, -half_rad]), np.array([1.0, 0.0, 1.0])))
    lines = rr.LineStrips2D(strips, colors=[*colours, _LOBE], radii=rr.Radius.ui_points(0.7), draw_order=1.0)
    ranges = [_place(_RING_LABELS_AT_RAD, range_m / outermost_m) for range_m in ranges_m]
    around = [_place(turned_rad, 1.1) for turned_rad in _LABELLED_RAD]
    beam = _place(half_rad + radians(8), 0.86)
    labels = rr.Points2D(
        [*ranges, *around, beam],
        labels=[
            *(f"{range_m:g} m" for range_m in ranges_m),
            *map(bearings.words, _LABELLED_RAD),
            f"beam {degrees(beam_width_rad):.0f}°",
        ],
        colors=[_LABEL],
        radii=rr.Radius.ui_points(0.1),
        show_labels=True,
        draw_order=1.0,
    )
    yield rerun_paths.unit_rings(unit), Together(lines, labels)


def draw_polar(unit: str, sweep: HeardSweep, outermost_m: float) -> Entries:
    """Echoes as arcs as wide as the beam, with the nearest one's range; at the edge grey dots where nothing was heard,
    and red ones where the sensor failed.
    """
    heard = np.flatnonzero(np.isfinite(sweep.range_m))
    across_rad = sweep.beam_width_rad * np.linspace(-0.5, 0.5, _ARC_POINTS)
    arcs = [
        _places(sweep.bearing_rad[each] + across_rad, np.full(_ARC_POINTS, sweep.range_m[each] / outermost_m))
        for each in heard
    ]
    lines = rr.LineStrips2D(arcs, colors=[unit_colour(unit)], radii=rr.Radius.ui_points(1.6), draw_order=10.0)
    edge = [*sweep.bearing_rad[sweep.silent], *sweep.bearing_rad[sweep.faulty]]
    colours = [SILENT] * int(sweep.silent.sum()) + [FAULTY] * int(sweep.faulty.sum())
    places = [_place(bearing_rad, 1.0) for bearing_rad in edge]
    labels = [""] * len(edge)
    if len(heard):
        nearest = heard[np.argmin(sweep.range_m[heard])]
        range_m, bearing_rad = float(sweep.range_m[nearest]), float(sweep.bearing_rad[nearest])
        places.append(_place(bearing_rad, range_m / outermost_m))
        colours.append(unit_colour(unit))
        labels.append(f"nearest {range_m:.2f} m, {bearings.words(bearing_rad)}")
    dots = rr.Points2D(
        places, colors=colours, labels=labels, show_labels=True, radii=rr.Radius.ui_points(3.5), draw_order=11.0
    )
    yield rerun_paths.unit_polar(unit), Together(lines, dots)


def _step_m(farthest_m: float) -> float:
    return next((step_m for step_m in _RING_STEPS_M if farthest_m <= _MOST_RINGS * step_m), _RING_STEPS_M[-1])


def _places(bearing_rad: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """(n, 2): y points down, as Rerun has it, and left is left."""
    return np.stack([-radius * np.sin(bearing_rad), -radius * np.cos(bearing_rad)], axis=1)


def _place(bearing_rad: float, radius: float) -> tuple[float, float]:
    return -radius * sin(bearing_rad), -radius * cos(bearing_rad)
