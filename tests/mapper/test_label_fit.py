"""The yardstick itself: the fit that is told every label, and the judge of contours."""

from dataclasses import replace

import numpy as np
import pytest
from mapper.judge import judge
from mapper.label_fit import label_fit, wall_lines
from mapper.room import HARD, PAPER, LabelledSweep, Physics, Room, paper_path, paper_room, survey_labelled
from scipy.stats import chi2

from noctule_mapper.contour.contour import Contour, Corner, Cylinder, Wall

UNCERTAIN = replace(PAPER, sigma_position_m=HARD.sigma_position_m, sigma_heading_rad=HARD.sigma_heading_rad)


def surveys(physics: Physics, seeds: range) -> list[list[LabelledSweep]]:
    return [survey_labelled(paper_room(), paper_path(), np.random.default_rng(seed), physics) for seed in seeds]


def test_in_the_papers_room_it_is_as_good_as_the_theory_says():
    # Corners 0.21 cm, cylinder's centre 0.10 and radius 0.04; over 80 surveys these means err by 3 to 8 %.
    fits = [label_fit(paper_room(), labelled) for labelled in surveys(PAPER, range(80))]
    off = np.array([fit.cylinders[0] - paper_room().cylinders[0] for fit in fits])
    corners_m = np.array([np.hypot(*(fit.corners - paper_room().vertices).T) for fit in fits])
    assert corners_m.mean() == pytest.approx(0.0021, rel=0.1)
    assert np.hypot(off[:, 0], off[:, 1]).mean() == pytest.approx(0.0010, rel=0.2)
    assert np.abs(off[:, 2]).mean() == pytest.approx(0.0004, rel=0.25)


@pytest.mark.parametrize("physics", [PAPER, UNCERTAIN], ids=["exact poses", "uncertain poses"])
def test_its_covariances_are_honest(physics):
    # Chi-square per kind, 0.1 % on each side; of a survey one wall and one corner, so that all are independent.
    squares = {"wall": [], "corner": [], "cylinder": []}
    for number, labelled in enumerate(surveys(physics, range(100, 180))):
        fit, i = label_fit(paper_room(), labelled), number % 5
        error = fit.walls[i] - wall_lines(paper_room())[i]
        squares["wall"].append(error @ np.linalg.solve(fit.wall_covariances[i], error))
        error = fit.corners[i] - paper_room().vertices[i]
        squares["corner"].append(error @ np.linalg.solve(fit.corner_covariances[i], error))
        error = fit.cylinders[0] - paper_room().cylinders[0]
        squares["cylinder"].append(error @ np.linalg.solve(fit.cylinder_covariances[0], error))
    for kind, freedom in (("wall", 2), ("corner", 2), ("cylinder", 3)):
        count = freedom * len(squares[kind])
        assert chi2.ppf(0.001, count) < sum(squares[kind]) < chi2.ppf(0.999, count), kind


def test_an_uncertain_pose_costs_it_accuracy_that_it_admits():
    (exact,), (uncertain,) = surveys(PAPER, range(1)), surveys(UNCERTAIN, range(1))
    widths = [np.trace(label_fit(paper_room(), one).corner_covariances[0]) for one in (exact, uncertain)]
    assert widths[1] > 1.5 * widths[0]


def test_false_echoes_do_not_touch_it():
    (labelled,) = surveys(PAPER, range(1))
    first = labelled[0]
    false = np.array([label.kind == "false" for label in first.labels])
    assert not false.any()
    at = next(i for i, label in enumerate(first.labels) if label.kind == "none")
    labels = tuple(type(label)("false") if i == at else label for i, label in enumerate(first.labels))
    ranges = np.where(np.arange(len(labels)) == at, 1.234, first.sweep.range_m)
    spoilt = [replace(first, sweep=replace(first.sweep, range_m=ranges), labels=labels), *labelled[1:]]
    assert label_fit(paper_room(), spoilt).corners == pytest.approx(label_fit(paper_room(), labelled).corners)


def test_what_no_echo_determines_it_does_not_report():
    # From three places by one side of the paper's room the far walls are not heard twice.
    labelled = survey_labelled(paper_room(), paper_path()[:3], np.random.default_rng(1))
    fit = label_fit(paper_room(), labelled)
    heard = [sum(label == ("wall", i) for one in labelled for label in one.labels) for i in range(5)]
    assert list(np.isnan(fit.walls[:, 0])) == [count < 2 for count in heard]
    assert 0 < sum(count < 2 for count in heard) < 5


def true_contour(room: Room) -> Contour:
    """The room itself, as if the mapper had found it."""
    small = 1e-6 * np.eye(2)
    walls = tuple(
        Wall(theta, rho, tuple(start), tuple(end), small, 9)
        for (theta, rho), start, end in zip(wall_lines(room), room.vertices, room.ends, strict=True)
    )
    corners = tuple(Corner(x, y, small, (i - 1, i)) for i, (x, y) in enumerate(room.vertices))
    return Contour(walls, corners, tuple(Cylinder(x, y, r, 1e-6 * np.eye(3), 9) for x, y, r in room.cylinders))


@pytest.fixture(scope="module")
def labelled() -> list[LabelledSweep]:
    return surveys(PAPER, range(1))[0]


def test_the_room_itself_is_without_fault(labelled):
    verdict = judge(true_contour(paper_room()), paper_room(), labelled)
    assert (verdict.missed, verdict.false) == ((), ())
    assert len(verdict.corners.mapper_m) == 5 and verdict.corners.mapper_m.max() < 1e-12
    assert len(verdict.centres.mapper_m) == len(verdict.radii.mapper_m) == 1
    squares = (*verdict.wall_squares, *verdict.corner_squares, *verdict.cylinder_squares)
    assert len(squares) == 11 and max(squares) < 1e-12


def test_an_empty_contour_misses_all_that_is_due(labelled):
    verdict = judge(Contour(), paper_room(), labelled)
    assert len(verdict.missed) == 6 and verdict.false == ()


def test_nothing_is_due_that_hardly_answered():
    labelled = survey_labelled(paper_room(), paper_path()[:3], np.random.default_rng(1))
    assert judge(Contour(), paper_room(), labelled).missed == ()


def test_many_echoes_from_one_place_make_no_corner_due():
    labelled = survey_labelled(paper_room(), np.tile(paper_path()[:1], (30, 1)), np.random.default_rng(1))
    assert judge(Contour(), paper_room(), labelled).missed == ()


def test_a_corner_6_cm_off_is_missed_and_false(labelled):
    true = true_contour(paper_room())
    moved = replace(true.corners[2], x_m=true.corners[2].x_m + 0.06)
    verdict = judge(replace(true, corners=(*true.corners[:2], moved, *true.corners[3:])), paper_room(), labelled)
    assert (len(verdict.missed), len(verdict.false), len(verdict.corners.mapper_m)) == (1, 1, 4)


def test_a_wall_is_false_unless_both_its_ends_are_near_one_true_wall(labelled):
    true, outline = true_contour(paper_room()), paper_room().vertices
    x, y = (outline[0] + outline[1]) / 2
    within = replace(true.walls[0], end=(x, y))
    astray = replace(true.walls[0], end=(x, y + 0.06))
    across = replace(true.walls[0], end=tuple(outline[2]))
    for wall, false in ((within, 0), (astray, 1), (across, 1)):
        assert len(judge(replace(true, walls=(wall,)), paper_room(), labelled).false) == false


def test_a_cylinder_of_another_radius_is_missed_and_false(labelled):
    true = true_contour(paper_room())
    thin = replace(true.cylinders[0], radius_m=0.448 - 0.06)
    verdict = judge(replace(true, cylinders=(thin,)), paper_room(), labelled)
    assert (len(verdict.missed), len(verdict.false)) == (1, 1)


def test_errors_are_set_against_the_label_fits_on_the_same_things(labelled):
    true = true_contour(paper_room())
    verdict = judge(replace(true, corners=true.corners[:2], cylinders=()), paper_room(), labelled)
    fit = label_fit(paper_room(), labelled)
    expected_m = np.hypot(*(fit.corners - paper_room().vertices)[:2].T)
    assert verdict.corners.label_fit_m == pytest.approx(expected_m)
    assert len(verdict.centres.label_fit_m) == 0
