"""What the board adds to the map: what is new or gone, planned paths, and how well the map fits what units hear."""

from collections.abc import Iterable
from math import pi
from typing import Any

import numpy as np
import pytest
from viewer.test_unit_pictures import BEAM_RAD, components

from noctule import rerun_paths
from noctule.messages_pb2 import Contour, Corner, Cylinder, Point, UnitPose, UnitStatus, Wall
from noctule.site import Pose2
from noctule_mapper.rerun_view.labels import labels
from noctule_viewer.board import fit_figures, plan_marks
from noctule_viewer.board.changes import SHOWN_S, Changes
from noctule_viewer.board.heard_sweeps import HeardSweep
from noctule_viewer.board.map_board import MapBoard
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import Heard

EAST, NORTH = 0.0, pi / 2


def room(*cylinders: Cylinder, walls: slice = slice(None)) -> Contour:
    """Four walls of four by three metres, of which ``walls``."""
    corners = [Point(), Point(x_m=4.0), Point(x_m=4.0, y_m=3.0), Point(y_m=3.0)]
    made = [Wall(start=start, end=end) for start, end in zip(corners, [*corners[1:], corners[0]], strict=True)]
    return Contour(walls=made[walls], cylinders=cylinders)


def chair(x_m: float) -> Cylinder:
    return Cylinder(x_m=x_m, y_m=1.5, radius_m=0.2)


def told(changes: Changes, now_s: float) -> list[tuple[str, bool, float]]:
    """Kind, whether it is gone, since when."""
    return [(each.object.kind, each.gone, each.since_s) for each in changes.changes(now_s)]


@pytest.fixture
def settled() -> Changes:
    """A room with a chair that has stood for ten minutes, from 0 s to 600 s."""
    changes = Changes()
    for second in range(0, 601, 10):
        changes.note(room(chair(1.0)), second)
    return changes


def test_a_map_that_has_just_begun_is_not_new_all_over() -> None:
    changes = Changes()
    changes.note(Contour(), 0.0)
    changes.note(room(walls=slice(2)), 100.0)
    changes.note(room(), 150.0)
    assert told(changes, 150.0) == []


def test_a_cylinder_that_was_moved_is_gone_from_one_place_and_new_at_another(settled: Changes) -> None:
    for second in range(610, 641, 10):
        settled.note(room(chair(2.0)), second)
    assert told(settled, 640.0) == [("cylinder", False, 610.0), ("cylinder", True, 600.0)]
    settled.note(room(chair(2.0)), 600.0 + SHOWN_S)
    settled.note(room(chair(2.0)), 611.0 + SHOWN_S)
    assert told(settled, 611.0 + SHOWN_S) == [], "marked for a while, then part of the map"


def test_what_flickers_or_grows_or_moves_by_its_error_is_no_change(settled: Changes) -> None:
    for second in range(610, 700, 10):
        shown = room(chair(1.0 + 0.02 * (second % 20)), walls=slice(4 if second % 20 else 3))
        shown.walls[0].end.x_m = 3.0  # not all of it is seen
        settled.note(shown, second)
    assert told(settled, 700.0) == []


def test_a_wall_that_is_gone_is_told(settled: Changes) -> None:
    for second in range(610, 641, 10):
        settled.note(room(chair(1.0), walls=slice(3)), second)
    assert told(settled, 640.0) == [("wall", True, 600.0)]
    drawn = components(plan_marks.draw_changes(settled.changes(640.0), 700.0), rerun_paths.CHANGES)
    assert drawn["Points2D:labels"] == ["gone 1 min ago"]
    assert drawn["Points2D:positions"] == [pytest.approx([0.0, 2.7])]  # a wall's length stands at its middle
    dashes = np.array(drawn["LineStrips2D:strips"])
    assert len(dashes) > 10
    assert np.all(dashes[..., 0] == 0.0)


def wall(start_m: float, end_m: float) -> Wall:
    return Wall(start=Point(x_m=start_m, y_m=1.0), end=Point(x_m=end_m, y_m=1.0))


def test_the_label_of_a_new_wall_does_not_lie_on_its_length(settled: Changes) -> None:
    contour = room(chair(1.0))
    contour.walls.append(wall(1.0, 3.0))
    settled.note(contour, 610.0)
    drawn = components(plan_marks.draw_changes(settled.changes(625.0), 625.0), rerun_paths.CHANGES)
    ((x_m, y_m),) = drawn["Points2D:positions"]
    (length,) = [label for label in labels(contour, {}) if label.text == "2.00 m"]
    px_m = 4.0 / 340.0  # of a map of four metres on a small page, as the mapper's labels have it
    letters_px = 7 * len("new 15 s ago") / 2 + 7 * len("2.00 m") / 2
    assert abs(length.place_m[0] - x_m) > letters_px * px_m or abs(length.place_m[1] - y_m) > 20 * px_m


@pytest.mark.parametrize("merged_first", [False, True])
def test_walls_that_merge_or_are_split_are_no_change(merged_first: bool) -> None:
    two, one = Contour(walls=[wall(0.0, 2.0), wall(2.5, 4.0)]), Contour(walls=[wall(0.0, 4.0)])
    before, after = (one, two) if merged_first else (two, one)
    changes = Changes()
    for second in range(700):
        changes.note(before if second < 600 else after, second)
    assert told(changes, 699.0) == []
    for second in range(700, 760):
        changes.note(Contour(walls=[wall(0.0, 2.0)] if merged_first else []), second)
    assert {gone for _, gone, _ in told(changes, 759.0)} == {True}, "the map is compared all the same"


def test_a_map_without_changes_has_the_marks_taken_away(settled: Changes) -> None:
    drawn = components(plan_marks.draw_changes(settled.changes(600.0), 600.0), rerun_paths.CHANGES)
    assert drawn["LineStrips2D:strips"] == []
    assert drawn["Points2D:labels"] == []


def test_stops_ahead_are_told_from_those_that_are_done() -> None:
    stops = [Pose2(0.2 * number, 0.0, 0.0) for number in range(5)]
    drawn = components(plan_marks.draw_path("u1", stops, 2), rerun_paths.planned_path("u1"))
    assert drawn["Points2D:labels"] == ["", "", "", "u1: next stop 3", "4"]
    alphas = [colour & 0xFF for colour in drawn["Points2D:colors"]]
    assert alphas[:3] == [70] * 3
    assert alphas[3:] == [220] * 2
    begun = components(plan_marks.draw_path("u1", stops, None), rerun_paths.planned_path("u1"))
    assert begun["Points2D:labels"][0] == "u1: next stop 0"
    done = components(plan_marks.draw_path("u1", stops, 4), rerun_paths.planned_path("u1"))
    assert done["Points2D:labels"] == [""] * 5


def heard_sweep(bearing_rad: list[float], range_m: list[float]) -> HeardSweep:
    """A unit in the middle of the room that looks east."""
    ranges = np.array(range_m)
    return HeardSweep(0.0, np.array(bearing_rad), ranges, np.isnan(ranges), BEAM_RAD, (2.0, 1.5, EAST))


def test_an_echo_is_held_against_the_wall_corner_or_cylinder_in_its_beam() -> None:
    contour = room(chair(1.0))
    contour.corners.append(Corner(x_m=4.0, y_m=3.0))
    corner_rad, corner_m = np.arctan2(1.5, 2.0), 2.5
    seen = heard_sweep([EAST, NORTH, pi, corner_rad, NORTH], [2.004, 1.49, 0.8, corner_m, np.nan])
    # 2 m to the wall in the east, 1.5 m to the north, the chair's rim 0.8 m in the west
    assert fit_figures.residuals_m(contour, {"u1": seen}) == pytest.approx([0.004, -0.01, 0.0, 0.0], abs=1e-6)


def test_a_unit_is_where_the_contour_has_it_and_one_whose_place_nobody_knows_is_left_out() -> None:
    contour = room()
    contour.poses.append(UnitPose(unit="u1", x_m=1.0, y_m=1.5))
    seen = heard_sweep([EAST], [3.0])
    assert fit_figures.residuals_m(contour, {"u1": seen}) == pytest.approx([0.0], abs=1e-9)
    nowhere = HeardSweep(0.0, seen.bearing_rad, seen.range_m, seen.silent, BEAM_RAD, None)
    assert len(fit_figures.residuals_m(contour, {"u2": nowhere})) == 0


def test_the_fit_says_how_many_echoes_the_map_explains_and_how_far_they_are_from_it() -> None:
    figures = fit_figures.fit(np.array([0.001, -0.003, 0.002, 1.2, np.nan]))
    assert figures == {"explained": pytest.approx(60.0), "distance": pytest.approx(2.0)}
    assert fit_figures.fit(np.array([np.nan])) == {"explained": 0.0}
    assert fit_figures.fit(np.zeros(0)) == {}


def test_errors_are_the_median_of_what_the_contour_states() -> None:
    contour = Contour(
        walls=[Wall(theta_rad=NORTH, rho_m=1.0, start=Point(x_m=-1, y_m=1), end=Point(x_m=1, y_m=1))],
        corners=[Corner(covariance=[s**2, 0.0, 0.0, 1e-8]) for s in (0.001, 0.004, 0.9)],
    )
    contour.walls[0].covariance[:] = [1e-4, 0.0, 0.0, 0.002**2]  # in its middle turning does not matter
    assert fit_figures.errors_mm(contour) == {"walls": pytest.approx(2.0), "corners": pytest.approx(4.0)}


def paths(entries: Iterable[tuple[str, Any]]) -> set[str]:
    return {path for path, _ in entries}


def test_what_stands_is_not_drawn_again_each_second() -> None:
    now_s = [0.0]
    status = UnitStatus(unit="u1", gateway="g", waypoint=1)
    plan = SitePlan("attic", {"u1": [Pose2(0.0, 0.0, 0.0)] * 3}, [np.zeros((2, 2))])
    board = MapBoard(plan, lambda: now_s[0])
    key = ("u1", "g")
    count = 0
    for second in range(60):
        now_s[0] = float(second)
        heard = Heard(float(second), units={key: status}, unit_silent_s={key: 0.0}, contour=room(chair(1.0)))
        found = paths(board.entries(heard))
        assert (rerun_paths.planned_path("u1") in found) == (second == 0)
        assert (rerun_paths.CHANGES in found) == (second == 0)
        count += len(found)
    assert count <= 2
    assert paths(board.statics()) == {rerun_paths.WORLD, rerun_paths.FLOOR_PLAN}


def test_y_points_up_also_where_no_mapper_draws() -> None:
    drawn = components(MapBoard(SitePlan("attic")).statics(), rerun_paths.WORLD)
    ((_, up, _),) = np.reshape(drawn["Transform3D:mat3x3"], (1, 3, 3))
    assert list(up) == [0, -1, 0]  # Rerun's own y points down


def test_a_floor_plan_that_is_not_given_any_more_is_taken_away() -> None:
    drawn = components(MapBoard(SitePlan("attic")).statics(), rerun_paths.FLOOR_PLAN)
    assert drawn["LineStrips2D:strips"] == []


def test_what_a_unit_heard_long_ago_says_nothing_of_the_map() -> None:
    now_s = [0.0]
    board = MapBoard(SitePlan("attic"), lambda: now_s[0])
    heard_at: dict[float, set[str]] = {}
    for second in (0.0, 590.0, 610.0):
        now_s[0] = second
        heard = Heard(second, contour=room(), sweeps={"u1": [heard_sweep([EAST], [2.0])]})
        heard_at[second] = paths(board.entries(heard))
    shown = [rerun_paths.map_fit("explained") in found for found in heard_at.values()]
    assert shown == [True, True, False]
