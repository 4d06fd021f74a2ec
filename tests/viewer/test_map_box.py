"""A picture that stands still: the bounds of the map, its scale, and how many layouts a relay is given."""

import pytest
from viewer.test_unit_pictures import components

from noctule import rerun_paths
from noctule.messages_pb2 import (
    Contour,
    Point,
    Touch,
    Wall,
)
from noctule_viewer.board import drawing, map_box
from noctule_viewer.board.layout_budget import LayoutBudget
from noctule_viewer.board.map_box import MapBox


def contour(width_m: float) -> Contour:
    return Contour(walls=[Wall(start=Point(), end=Point(x_m=width_m, y_m=0.0))])


def test_the_picture_stands_still_while_the_map_fits_and_grows_with_it() -> None:
    alone = map_box.shown(None, [(1.0, 2.0), (3.0, 2.0)], None)
    assert map_box.shown(None, [(1.0, 2.0), (2.0, 2.5)], alone) is alone  # each new box is a new layout
    assert alone == MapBox(-1.0, 0.0, 5.0, 4.0)  # two metres around units, before there is a map
    assert map_box.shown(contour(4.0), [(2.0, 3.0)], alone) == MapBox(-0.48, -0.48, 4.48, 3.48)
    first = map_box.shown(contour(4.0), [(2.0, 3.0)], None)
    assert first == MapBox(-0.48, -0.48, 4.48, 3.48)  # 12 % of four metres around
    assert map_box.shown(contour(4.3), [(2.0, 3.0)], first) == first
    assert map_box.shown(contour(2.5), [], first) == first
    assert map_box.shown(None, [], first) == first
    touch = Contour(touches=[Touch(x_m=2.6)])
    assert map_box.shown(touch, [(0.0, 0.0)], None) == MapBox(-2.0, -2.0, 4.6, 2.0)  # two metres around what is heard
    wider = map_box.shown(contour(8.0), [], first)
    assert wider is not None
    assert wider == MapBox(-0.48, -0.48, 12.0, 3.48)  # half of eight metres beyond, where it has grown


def test_a_survey_that_grows_step_by_step_stays_in_the_picture_with_few_layouts() -> None:
    now_s = [0.0]
    budget = LayoutBudget(lambda: now_s[0])
    laid_out: MapBox | None = None
    for decimetres in range(40, 1_000):  # from a room to a hall of 100 m, in less than three hours
        now_s[0] += 10.0
        wanted = map_box.shown(contour(decimetres / 10), [(2.0, 3.0)], laid_out)
        if wanted != laid_out and budget.take(for_units=laid_out is None):
            laid_out = wanted
        assert laid_out is not None
        assert laid_out.right_m >= decimetres / 10


def test_neither_a_map_that_grows_nor_units_that_come_use_up_all_layouts() -> None:
    for for_units in (False, True):
        now_s = [0.0]
        budget = LayoutBudget(lambda now_s=now_s: now_s[0])
        taken = 0
        for _ in range(100):
            now_s[0] += 10.0
            taken += budget.take(for_units)
        assert taken == 9
        assert budget.take(not for_units) is True
        now_s[0] += 9.0
        assert budget.take(not for_units) is False, "two layouts within ten seconds"
        now_s[0] += 1.0
        assert budget.take(not for_units) is True
        now_s[0] += 6 * 3_600
        assert budget.take(for_units) is True


@pytest.mark.parametrize(
    ("side_m", "spacing_m"), [(0.9, 0.1), (4.0, 0.5), (11.0, 1.0), (30.0, 5.0), (200.0, 20.0), (12.0, 1.0)]
)
def test_the_scale_has_at_most_a_dozen_lines_of_a_round_distance(side_m: float, spacing_m: float) -> None:
    assert map_box.line_spacing_m(MapBox(0.0, 0.0, side_m, 1.0)) == pytest.approx(spacing_m)


def test_the_scales_labels_keep_clear_of_the_edges_that_would_cut_them_off() -> None:
    box = MapBox(-1.0, -1.0, 3.0, 2.0)
    drawn, between = (
        components(drawing.draw_scale(box), path) for path in (rerun_paths.SCALE, rerun_paths.SCALE_BETWEEN)
    )
    assert drawn["Points2D:labels"] == ["0 m", "1 m", "2 m", "0 m", "1 m"]
    beside_them = ["-0.5 m", "0.5 m", "1.5 m", "2.5 m", "-0.5 m", "0.5 m", "1.5 m"]
    assert between["Points2D:labels"] == beside_them
