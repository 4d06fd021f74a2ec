"""Fusion rules as sums of readings that come and go, and the nodes of their integrals."""

from typing import get_args

import numpy as np
import pytest

from noctule_mapper.fusion import fuse
from noctule_mapper.fusion.quadrature import COUNTS, LEAST_SUM, MOST_SUM, design, nodes, worst_case
from noctule_mapper.fusion.streams import StreamedRule, stream
from noctule_mapper.grid.pcr5_fold import folded_pcr5


@pytest.mark.parametrize("rule", get_args(StreamedRule))
def test_a_reading_that_is_taken_out_again_leaves_no_trace(rule):
    sums = stream(rule)
    first, second, third = (sums.terms(np.array(one)) for one in ((0.6, 0.1, 0.3), (0.0, 0.9, 0.1), (0.4, 0.1, 0.5)))
    assert sums.belief(first + second + third - second) == pytest.approx(sums.belief(first + third), abs=1e-12)


@pytest.mark.parametrize("rule", get_args(StreamedRule))
def test_readings_one_by_one_give_what_all_at_once_give(rule):
    masses = np.random.default_rng(4).dirichlet((1, 1, 1), size=6)
    sums = stream(rule)
    state = np.zeros_like(sums.terms(masses[0]))
    for reading in masses:
        state = state + sums.terms(reading)
    assert sums.belief(state) == pytest.approx(fuse(masses, rule), abs=1e-12)


def test_folded_pcr5_of_two_readings_is_pcr5():
    lexicon = np.array([(0.0, 0.3, 0.7), (0.5, 0.4, 0.1), (0.7, 0.1, 0.2)])
    counts = np.array([(0, 1, 1), (1, 0, 1)])
    expected = [fuse(lexicon[[1, 2]], "pcr5"), fuse(lexicon[[0, 2]], "pcr5")]
    assert folded_pcr5(lexicon).belief(counts) == pytest.approx(np.array(expected), abs=1e-12)


def test_folded_pcr5_takes_what_is_free_first_and_the_surest_of_the_occupied_last():
    lexicon = np.array([(0.7, 0.1, 0.2), (0.0, 0.3, 0.7), (0.5, 0.4, 0.1)])
    belief = fuse(np.tile(lexicon[1], (2, 1)), "pcr5")
    for reading in lexicon[[2, 0, 0]]:
        belief = fuse(np.stack([belief, reading]), "pcr5")
    assert folded_pcr5(lexicon).belief(np.array([(2, 2, 1)]))[0] == pytest.approx(belief, abs=1e-12)


def test_the_table_of_nodes_is_what_its_design_gives():
    count = min(COUNTS)
    assert np.concatenate(nodes(count)) == pytest.approx(np.concatenate(design(count)), rel=1e-3)


def test_thirty_two_nodes_share_any_product_to_a_millionth():
    t, w = nodes(32)
    sums = np.geomspace(LEAST_SUM, MOST_SUM, 20_000)
    error = np.abs(sums * (np.exp(-np.outer(sums, t)) @ w) - 1) * worst_case(sums)
    assert error.max() < 1e-6
