"""Feature points: where they lie, how well, and on a map that is in several places."""

from dataclasses import replace

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.contacts.voting import Kind
from noctule_mapper.mapper import Mapper

SURVEY = survey(paper_room(), paper_path(), np.random.default_rng(12))
SWEEPS = SURVEY[:12]
FAR_M = 4000.0  # a dense array of all cells between the two would take 80 GB


def mapped(sweeps) -> Mapper:
    mapper = Mapper()
    for sweep in sweeps:
        mapper.register_sweep(sweep)
    return mapper


def test_two_places_far_apart_have_the_feature_points_of_each():
    moved = [
        replace(sweep, identity=("far", sweep.identity[1]), x_m=sweep.x_m + FAR_M, y_m=sweep.y_m - FAR_M)
        for sweep in SWEEPS
    ]
    alone, both = mapped(SWEEPS).feature_points(), mapped([*SWEEPS, *moved]).feature_points()
    near = both.x_m < FAR_M / 2
    assert sorted(both.x_m[near]) == sorted(alone.x_m)
    assert near.sum() == pytest.approx((~near).sum(), abs=0.1 * near.sum())  # cells lie a little differently there


def test_points_on_the_cylinder_lie_on_it_and_not_inside_where_its_chords_are():
    points = mapped(SURVEY).feature_points()
    ((x, y, radius_m),) = paper_room().cylinders
    off_m = np.hypot(points.x_m - x, points.y_m - y) - radius_m
    of_it = (points.kind == Kind.CYLINDER) & (np.abs(off_m) < 0.03)
    assert of_it.sum() > 20
    # Their mean is good to 3.2 mm / sqrt(20); blocks of 0.2 m would put them 3 mm inside.
    assert abs(off_m[of_it].mean()) < 0.0015
    assert np.mean((off_m / points.sigma_m)[of_it] ** 2) == pytest.approx(1, abs=0.6)


def test_points_on_walls_err_as_they_say():
    points = mapped(SURVEY).feature_points()
    room = paper_room()
    along = (room.ends - room.vertices) / np.hypot(*(room.ends - room.vertices).T)[:, None]
    normal = np.stack([along[:, 1], -along[:, 0]], axis=1)
    places = np.stack([points.x_m, points.y_m], axis=1)
    off_m = np.abs(((places[:, None] - room.vertices) * normal).sum(axis=2)).min(axis=1)
    flat = (points.kind == Kind.WALL) & (off_m < 0.015)  # beyond are feet on a corner's echoes
    assert flat.sum() > 40
    assert np.mean((off_m / points.sigma_m)[flat] ** 2) == pytest.approx(1, abs=0.5)


def test_a_point_of_one_contact_errs_along_the_reflector_as_its_direction_does_and_one_of_many_less():
    mapper = mapped(SURVEY)
    points, report = mapper.feature_points(), mapper.contact_report()
    along_m = (report.echoes.range_m * report.circles.direction_sigma_rad)[report.circles.kind != Kind.NONE]
    alone = np.isclose(points.sigma_along_m[:, None], along_m, rtol=1e-9).any(axis=1)
    assert 0.2 < alone.mean() < 1
    assert points.sigma_along_m.max() <= along_m.max() * (1 + 1e-9)
    assert np.median(points.sigma_m[~alone]) < 0.9 * np.median(points.sigma_m[alone])


def test_points_are_worked_out_once_for_the_sweeps_on_the_map():
    mapper = mapped(SWEEPS)
    points = mapper.feature_points()
    mapper.contour()
    assert mapper.feature_points() is points
    mapper.remove_sweep(SWEEPS[0].identity)
    fewer = mapper.feature_points()
    assert sorted(fewer.x_m) == pytest.approx(sorted(mapped(SWEEPS[1:]).feature_points().x_m))
    mapper.register_sweep(SURVEY[12])
    assert sorted(mapper.feature_points().x_m) != sorted(fewer.x_m)
