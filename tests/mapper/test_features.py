"""Feature points of a map that is in several places."""

from dataclasses import replace

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.mapper import Mapper

SWEEPS = survey(paper_room(), paper_path(), np.random.default_rng(12))[:12]
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
    alone, both = mapped(SWEEPS).feature_points, mapped([*SWEEPS, *moved]).feature_points
    near = both.x_m < FAR_M / 2
    assert sorted(both.x_m[near]) == sorted(alone.x_m)
    assert near.sum() == pytest.approx((~near).sum(), abs=0.1 * near.sum())  # cells lie a little differently there
