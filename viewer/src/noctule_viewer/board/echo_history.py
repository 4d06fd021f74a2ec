"""What a unit has heard, as a picture: a row for each sweep, the newest on top, a column for each bearing, a colour for
each range.
"""

import io
from collections.abc import Sequence
from math import ceil, floor, radians
from typing import TypeVar

import numpy as np
import rerun as rr
from PIL import Image

from noctule import rerun_paths
from noctule_viewer import blueprint
from noctule_viewer.board import bearings
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.heard_sweeps import MOST_SWEEPS, HeardSweep
from noctule_viewer.board.polar import FAULTY, SILENT
from noctule_viewer.board.words import hour

Bearings = TypeVar("Bearings", float, np.ndarray)

COLUMNS, ROWS = 480, MOST_SWEEPS
LEFT, RIGHT, ABOVE, BELOW = 50.0, 24.0, 26.0, 26.0  # room for the labels, in the picture's pixels
_WHOLE_RAD = radians(45)  # the picture begins and ends at a multiple of it, each of which is labelled
_HOURS_EVERY = 30  # rows
_TEXT = (140, 150, 166)
# From near to far, all of them bright on the dark ground, and none like silence or a fault.
_COLOURS = np.array([(255, 236, 120), (170, 220, 90), (60, 200, 150), (50, 160, 210), (90, 120, 235), (165, 110, 225)])


def draw_echo_history(unit: str, sweeps: Sequence[HeardSweep], outermost_m: float, now_s: float) -> Entries:
    """The picture of ``sweeps``, the newest of which is the last, and the labels around it."""
    first_rad, last_rad = _span_rad(sweeps)
    rows = [_row(each, first_rad, last_rad, outermost_m) for each in reversed(sweeps)]
    picture = np.full((ROWS, COLUMNS, 3), blueprint.CALM, np.uint8)
    picture[: len(rows)] = rows[:ROWS]
    png = io.BytesIO()
    Image.fromarray(picture).quantize(64).save(png, "PNG")
    yield (
        rerun_paths.unit_echo_history(unit),
        rr.EncodedImage(contents=png.getvalue(), media_type="image/png", draw_order=0.0),
    )
    yield rerun_paths.unit_echo_axes(unit), _axes(sweeps, first_rad, last_rad, outermost_m, now_s)


def _axes(
    sweeps: Sequence[HeardSweep], first_rad: float, last_rad: float, outermost_m: float, now_s: float
) -> rr.Points2D:
    """Bearings above, hours at the left, and below what the colours mean."""
    turns = range(round(first_rad / _WHOLE_RAD), round(last_rad / _WHOLE_RAD) + 1)
    above = [
        ((_column(turn * _WHOLE_RAD, first_rad, last_rad), -0.85 * ABOVE), bearings.words(turn * _WHOLE_RAD), _TEXT)
        for turn in turns
    ]
    newest_first = list(reversed(sweeps))
    beside = [
        ((-LEFT / 2, row + 0.5), hour(newest_first[row].time_s, now_s), _TEXT)
        for row in range(0, len(newest_first), _HOURS_EVERY)
    ]
    shares = np.linspace(0.0, 1.0, len(_COLOURS))
    ranges = [(f"{share * outermost_m:.1f} m", tuple(_colour(np.array([share]))[0])) for share in shares]
    meanings = [*ranges, ("no echo", SILENT), ("fault", FAULTY)]
    below = [
        ((COLUMNS * (number + 0.5) / len(meanings), ROWS + BELOW / 3), text, colour)
        for number, (text, colour) in enumerate(meanings)
    ]
    places, labels, colours = zip(*above, *beside, *below, strict=True)
    radii = [0.1] * (len(above) + len(beside)) + [5.0] * len(below)
    return rr.Points2D(
        places, labels=labels, colors=colours, radii=rr.Radius.ui_points(radii), show_labels=True, draw_order=1.0
    )


def _row(sweep: HeardSweep, first_rad: float, last_rad: float, outermost_m: float) -> np.ndarray:
    """(COLUMNS, 3) RGB: each bearing as wide as the way to its neighbours, nothing where the unit has not looked."""
    column = _column(sweep.bearing_rad, first_rad, last_rad)
    nearest = np.abs(np.arange(COLUMNS)[:, None] + 0.5 - column).argmin(axis=1)
    apart = np.median(np.diff(np.sort(column))) if len(column) > 1 else COLUMNS / 36
    looked = np.abs(np.arange(COLUMNS) + 0.5 - column[nearest]) <= max(apart, 1.0) * 0.51
    colours = _colour(np.nan_to_num(sweep.range_m / outermost_m))
    colours[sweep.silent], colours[sweep.faulty] = SILENT, FAULTY
    return np.where(looked[:, None], colours[nearest], blueprint.CALM).astype(np.uint8)


def _colour(share: np.ndarray) -> np.ndarray:
    """(n, 3) colours of ranges as shares of the outermost one, (n,)."""
    steps = np.linspace(0.0, 1.0, len(_COLOURS))
    return np.stack([np.interp(share, steps, channel) for channel in _COLOURS.T], axis=1).round().astype(int)


def _span_rad(sweeps: Sequence[HeardSweep]) -> tuple[float, float]:
    """The first and the last bearing of the picture, with all of ``sweeps`` between them."""
    bearing_rad = np.concatenate([each.bearing_rad for each in sweeps])
    first, last = floor(bearing_rad.min() / _WHOLE_RAD), ceil(bearing_rad.max() / _WHOLE_RAD)
    return first * _WHOLE_RAD, max(last, first + 1) * _WHOLE_RAD


def _column(bearing_rad: Bearings, first_rad: float, last_rad: float) -> Bearings:
    """Where a bearing, or (n,) of them, lies across the picture: left is left."""
    return COLUMNS * (last_rad - bearing_rad) / (last_rad - first_rad)
