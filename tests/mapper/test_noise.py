"""The spread of the ranges, estimated from the survey where nobody has calibrated it."""

import tracemalloc

import numpy as np
import pytest
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.config import MapperConfig, NoiseConfig
from noctule_mapper.contacts.voting import Contacts, Kind
from noctule_mapper.readings.echoes import Echoes, echoes_of, join
from noctule_mapper.readings.spread import estimate_sigma_m, scaled_deviations_m
from noctule_mapper.refinement.refine import refine


def echoes(sigma_m: float, seed: int, sweeps: int = 44) -> Echoes:
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


def test_the_estimate_looks_at_no_more_echoes_than_it_needs():
    # 600 middles and 2000 neighbours make matrices of 9.6 MB, some at a time; all the echoes would make them 190 MB.
    many = join([echoes(0.0032, 1)] * 200)
    assert len(many) > 30_000
    assert _peak_bytes(lambda: estimate_sigma_m(many, NoiseConfig())) < 120e6


def test_a_unit_that_has_stood_still_for_three_thousand_sweeps_counts_as_its_newest():
    # Of its 15,000 echoes there are some arrays of 0.1 MB; a matrix of 600 of them by 2000 neighbours would be 9.6 MB.
    still = join([echoes(0.0032, 1, sweeps=1)] * 3000)
    none = np.zeros(len(still))
    untouched = Contacts(none, none, np.full(len(still), Kind.NONE), none, none)
    assert _peak_bytes(lambda: refine(still, untouched, None, MapperConfig())) < 9e6


def _peak_bytes(work) -> int:
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
