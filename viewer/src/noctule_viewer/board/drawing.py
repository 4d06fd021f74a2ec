"""The board in Rerun: documents, temperatures, the map's scale, and marks on units that are not well."""

from collections.abc import Sequence
from functools import partial

import rerun as rr

from noctule import rerun_paths
from noctule.rerun_together import Together
from noctule.unit_colours import unit_colour
from noctule_viewer.board import documents, map_box
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.board.site_state import Heard
from noctule_viewer.board.unit_health import Health, UnitHealth

_markdown = partial(rr.TextDocument, media_type="text/markdown")
_MARKS = {Health.ATTENTION: (255, 176, 32), Health.AWAY: (235, 64, 64)}
_LINE, _LINE_LABEL = (44, 52, 66), (120, 130, 146)
_LABEL_INSET = 0.03  # of the map's larger side
_LABELS_ABOVE = 0.055  # in the same way: a label hangs below its place, and a unit's tab has a small map
_SCALE_ORDER, _MARK_ORDER = 1.0, 39.0  # above the grid's tiles; below the units' own dots


def draw_alarms(site: str, units: Sequence[UnitHealth], heard: Heard, elsewhere: Sequence[str]) -> Entries:
    """What is wrong and what time it is, each second: a page on which the time stands still shows the past."""
    yield rerun_paths.ALARMS, _markdown(documents.alarms(site, units, heard, elsewhere))


def draw_units(units: Sequence[UnitHealth], heard: Heard) -> Entries:
    """The table, and marks on the map."""
    yield rerun_paths.UNITS_TABLE, _markdown(documents.table(units, heard.now_s))
    yield rerun_paths.HEALTH, _marks(units, heard)


def draw_sheet(unit: UnitHealth, heard: Heard) -> Entries:
    """All that is known of one unit."""
    yield rerun_paths.unit_sheet(unit.unit), _markdown(documents.sheet(unit, heard.now_s))


def draw_temperatures(units: Sequence[UnitHealth]) -> Entries:
    """Of the chips of those units that are heard."""
    for unit in units:
        status = unit.status
        if unit.health is not Health.AWAY and status is not None and status.HasField("chip_temperature_c"):
            line = rr.SeriesLines(colors=[unit_colour(unit.unit)], names=[unit.unit])
            yield rerun_paths.unit_temperature(unit.unit), Together(rr.Scalars(status.chip_temperature_c), line)


def draw_scale(box: MapBox) -> Entries:
    """Lines at whole metres, or what fits the map, with their coordinates near the left and the lower edge: every other
    one in an entity of its own, because a unit's tab has no room for it.
    """
    spacing_m = map_box.line_spacing_m(box)
    across = map_box.multiples(box.left_m, box.right_m, spacing_m)
    up = map_box.multiples(box.bottom_m, box.top_m, spacing_m)
    lines = [[(x_m, box.bottom_m), (x_m, box.top_m)] for x_m in across]
    lines += [[(box.left_m, y_m), (box.right_m, y_m)] for y_m in up]
    strips = rr.LineStrips2D(lines, colors=[_LINE], radii=rr.Radius.ui_points(0.5), draw_order=_SCALE_ORDER)
    # A view cuts labels off at its edge.
    left_m, bottom_m = box.left_m + _LABEL_INSET * box.side_m, box.bottom_m + _LABELS_ABOVE * box.side_m
    right_m, top_m = (edge_m - _LABEL_INSET * box.side_m for edge_m in (box.right_m, box.top_m))
    below = [(x_m, bottom_m, x_m) for x_m in across if left_m < x_m < right_m]
    beside = [(left_m, y_m, y_m) for y_m in up if bottom_m < y_m < top_m]
    even, odd = [], []
    for label in (*below, *beside):
        (odd if round(label[2] / spacing_m) % 2 else even).append(label)
    yield rerun_paths.SCALE, Together(strips, _coordinates(even))
    yield rerun_paths.SCALE_BETWEEN, _coordinates(odd)


def _coordinates(labels: Sequence[tuple[float, float, float]]) -> rr.Points2D:
    """Where each stands, and what it says, in metres."""
    return rr.Points2D(
        [(x_m, y_m) for x_m, y_m, _ in labels],
        colors=[_LINE_LABEL],
        radii=rr.Radius.ui_points(1.0),
        labels=[f"{coordinate_m:g} m" for *_, coordinate_m in labels],
        show_labels=True,
        draw_order=_SCALE_ORDER,
    )


def _marks(units: Sequence[UnitHealth], heard: Heard) -> rr.Points2D:
    unwell = [unit for unit in units if unit.health in _MARKS and unit.unit in heard.stands_m]
    return rr.Points2D(
        [heard.stands_m[unit.unit] for unit in unwell],
        colors=[_MARKS[unit.health] for unit in unwell],
        radii=rr.Radius.ui_points(15.0),
        draw_order=_MARK_ORDER,
    )
