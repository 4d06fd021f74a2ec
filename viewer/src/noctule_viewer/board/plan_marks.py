"""On the map: what is new or gone, and the paths that units are carried along."""

from collections.abc import Sequence
from itertools import pairwise
from math import hypot

import rerun as rr

from noctule import rerun_paths
from noctule.ages import age
from noctule.rerun_together import Together
from noctule.site import Pose2
from noctule.unit_colours import unit_colour
from noctule_viewer.board.changes import Change, Point, outline_m
from noctule_viewer.board.entries import Entries

_NEW, _GONE = (120, 255, 130), (255, 110, 200)
_ORDER, _LABEL_ORDER = 25.0, 45.0  # under the contour, and on top of all
_MOST_LABELS = 10
_DASH_M = 0.08
_DONE_ALPHA, _AHEAD_ALPHA = 70, 220
_STOPS_LABELLED = 12


def draw_changes(changes: Sequence[Change], now_s: float) -> Entries:
    """What is new as broad green lines, what is gone as dashes, and since when."""
    strips, colours = [], []
    for change in changes:
        outline = outline_m(change.object)
        parts = _dashes(outline) if change.gone else [outline]
        strips += parts
        colours += [_GONE if change.gone else _NEW] * len(parts)
    radii = rr.Radius.ui_points(6.0)
    lines = rr.LineStrips2D(strips, colors=colours, radii=radii, draw_order=_ORDER)
    labelled = changes[:_MOST_LABELS]
    labels = rr.Points2D(
        [change.object.label_place for change in labelled],
        labels=[f"{'gone' if change.gone else 'new'} {age(now_s - change.since_s)}" for change in labelled],
        colors=[_GONE if change.gone else _NEW for change in labelled],
        radii=rr.Radius.ui_points(0.1),
        show_labels=True,
        draw_order=_LABEL_ORDER,
    )
    yield rerun_paths.CHANGES, Together(lines, labels)


def draw_path(unit: str, stops: Sequence[Pose2], waypoint: int | None) -> Entries:
    """The planned stops of ``unit``: those up to ``waypoint`` faint, those ahead bright, the next one by name."""
    colour, ahead = unit_colour(unit), 0 if waypoint is None else waypoint + 1
    places = [(stop.x_m, stop.y_m) for stop in stops]
    done, coming = places[:ahead], places[max(0, ahead - 1) :]
    ways = [done] if len(done) > 1 else []
    strips = [*ways, *_dashes(coming)]
    colours = [(*colour, _DONE_ALPHA)] * len(ways) + [(*colour, _AHEAD_ALPHA)] * (len(strips) - len(ways))
    lines = rr.LineStrips2D(strips, colors=colours, radii=rr.Radius.ui_points(1.0), draw_order=_ORDER)
    every = max(1, len(places) // _STOPS_LABELLED)
    labels = [str(number) if number - ahead >= every and number % every == 0 else "" for number in range(len(places))]
    if ahead < len(places):
        labels[ahead] = f"{unit}: next stop {ahead}"
    alphas = [_DONE_ALPHA if number < ahead else _AHEAD_ALPHA for number in range(len(places))]
    dots = rr.Points2D(
        places,
        labels=labels,
        colors=[(*colour, alpha) for alpha in alphas],
        radii=rr.Radius.ui_points([5.0 if number == ahead else 2.5 for number in range(len(places))]),
        show_labels=True,
        draw_order=_ORDER,
    )
    yield rerun_paths.planned_path(unit), Together(lines, dots)


def _dashes(line: Sequence[Point]) -> list[list[Point]]:
    """``line`` with gaps as long as the dashes."""
    dashes = []
    for start, end in pairwise(line):
        length_m = hypot(end[0] - start[0], end[1] - start[1])
        count = max(1, round(length_m / (2 * _DASH_M)))
        for number in range(count):
            share, stop = number / count, (number + 0.5) / count
            dashes.append([_between(start, end, share), _between(start, end, stop)])
    return dashes


def _between(start: Point, end: Point, share: float) -> Point:
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])
