"""The spread of the ranges, estimated from the survey where nobody has calibrated it."""

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import NoiseConfig
from noctule_mapper.echoes import echoes_of, join
from noctule_mapper.noise import estimate_sigma_m, scaled_deviations_m


def echoes(sigma_m: float, seed: int, sweeps: int = 44):
    made = survey(paper_room(), paper_path()[:sweeps], np.random.default_rng(seed), sigma_m)
    return join([echoes_of(sweep, number, 0.0032) for number, sweep in enumerate(made)])


@pytest.mark.parametrize("sigma_m", [0.0032, 0.01, 0.02, 0.03])
def test_the_estimate_is_right_to_within_half_for_any_spread(sigma_m):
    # Some hundred triples make it good to a tenth; those of the cylinder and the corners widen a small one.
    estimates_m = [estimate_sigma_m(echoes(sigma_m, seed), NoiseConfig()) for seed in (1, 2, 3)]
    assert 0.75 * sigma_m < np.mean(estimates_m) < 1.5 * sigma_m


def test_too_few_triples_leave_the_assumed_spread():
    assert estimate_sigma_m(echoes(0.03, 1, sweeps=3), NoiseConfig()) == NoiseConfig().assumed_sigma_m


def test_exact_ranges_of_walls_deviate_by_nothing():
    deviations_m = scaled_deviations_m(echoes(1e-9, 1), 0.08, 0.45)
    assert np.median(np.abs(deviations_m)) < 1e-6
