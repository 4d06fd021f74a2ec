"""Fusion of beliefs, against the figures that the papers print, an independent library, and the sum written out."""

from itertools import permutations, product
from typing import get_args

import numpy as np
import pytest
from evidencelib import Frame, MassFunction
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule_mapper.fusion import Rule, evidence, fuse
from noctule_mapper.quadrature import COUNTS, LEAST_SUM, MOST_SUM, design, nodes

FRAME = Frame.dst(["O", "F"])
LIBRARY = {
    "pcr6+": lambda first, *others: first.pcr6_plus(*others),
    "pcr6": lambda first, *others: first.pcr6(*others),
    "pcr5": lambda first, *others: first.pcr5(*others),
    "pcr2": lambda first, *others: first.pcr2(*others),
    "dempster": lambda first, *others: first.dempster(*others),
}


@st.composite
def beliefs(draw: st.DrawFn, most: int = 5) -> np.ndarray:
    """Two to ``most`` beliefs, (sources, 3)."""
    part = st.tuples(*[st.floats(0.02, 1)] * 3)
    raw = np.array(draw(st.lists(part, min_size=2, max_size=most)))
    return raw / raw.sum(axis=1, keepdims=True)


@pytest.mark.parametrize(
    ("rule", "sources", "printed"),
    [
        # Smarandache & Dezert, arXiv cs/0408064, sections 11.1.1 to 11.1.3 and 12.2.
        ("pcr5", [(0.6, 0, 0.4), (0, 0.3, 0.7)], (0.54, 0.18, 0.28)),
        ("pcr6", [(0.6, 0, 0.4), (0, 0.3, 0.7)], (0.54, 0.18, 0.28)),
        ("pcr5", [(0.6, 0, 0.4), (0.2, 0.3, 0.5)], (0.62, 0.18, 0.20)),
        ("pcr6", [(0.6, 0.3, 0.1), (0.2, 0.3, 0.5)], (0.584, 0.366, 0.05)),
        ("dempster", [(0.6, 0.3, 0.1), (0.2, 0.3, 0.5)], (0.579, 0.355, 0.066)),
        ("pcr2", [(0.7, 0.1, 0.2), (0.5, 0.4, 0.1)], (0.752941, 0.227059, 0.02)),
        ("pcr5", [(0.7, 0.1, 0.2), (0.5, 0.4, 0.1)], (0.739849, 0.240151, 0.02)),
        ("dempster", [(0.7, 0.1, 0.2), (0.5, 0.4, 0.1)], (0.776119, 0.194030, 0.029851)),
        # Martin & Osswald 2006, section 3: A, B, B, all certain.
        ("pcr6", [(1, 0, 0), (0, 1, 0), (0, 1, 0)], (1 / 3, 2 / 3, 0)),
        ("pcr6+", [(1, 0, 0), (0, 1, 0), (0, 1, 0)], (1 / 3, 2 / 3, 0)),
        # Dezert, Dambreville & Smarandache, JAIF 16(1), 2021, example 2.
        ("pcr6", [(0.6, 0.1, 0.3), (0.5, 0.3, 0.2), (0.4, 0.1, 0.5)], (0.743496, 0.162245, 0.094259)),
        ("pcr6+", [(0.6, 0.1, 0.3), (0.5, 0.3, 0.2), (0.4, 0.1, 0.5)], (0.788847, 0.181153, 0.03)),
    ],
)
def test_a_rule_gives_what_its_paper_prints(rule, sources, printed):
    digits = 5e-4 if rule == "dempster" and printed[0] == 0.579 else 1e-6
    assert fuse(np.array(sources, float), rule) == pytest.approx(printed, abs=digits)


@pytest.mark.parametrize("rule", LIBRARY)
@given(masses=beliefs(most=4))
@settings(max_examples=30, deadline=None)
def test_every_rule_agrees_with_an_independent_library(rule, masses):
    functions = [MassFunction(FRAME, {"O": o, "F": f, "O|F": u}, tolerance=1e-6) for o, f, u in masses]
    expected = LIBRARY[rule](*functions)
    assert fuse(masses, rule) == pytest.approx([expected.mass(key) for key in ("O", "F", "O|F")], abs=1e-6)


@given(masses=beliefs(most=7))
@settings(max_examples=40, deadline=None)
def test_pcr6_plus_in_one_pass_is_the_sum_over_all_products_to_a_millionth(masses):
    assert fuse(masses) == pytest.approx(pcr6_plus_written_out(masses), abs=1e-6)


def pcr6_plus_written_out(masses: np.ndarray) -> np.ndarray:
    """JAIF 16(1) 2021, Eq. 23-26, on this frame: all 3^s products, each shared by the masses that chose O and those
    that chose F.
    """
    occupied = 0.0
    for choice in product(range(3), repeat=len(masses)):
        chosen = masses[np.arange(len(masses)), choice]
        for_occupied, for_free = (chosen[np.array(choice) == set_].sum() for set_ in (0, 1))
        if for_occupied > 0:
            occupied += chosen.prod() * for_occupied / (for_occupied + for_free)
    unknown = masses[:, 2].prod()
    return np.array([occupied, 1 - occupied - unknown, unknown])


def test_the_order_of_readings_does_not_matter():
    masses = np.array([(1.0, 0, 0), (0, 1, 0), (0, 0.7, 0.3), (0.2, 0.1, 0.7)])
    results = np.array([fuse(np.array(order)) for order in permutations(masses)])
    assert np.ptp(results, axis=0).max() < 1e-12


def test_a_reading_that_knows_nothing_changes_nothing():
    masses = np.array([(0.6, 0.1, 0.3), (0.5, 0.3, 0.2)])
    assert fuse(np.vstack([masses, [(0, 0, 1)]])) == pytest.approx(fuse(masses), abs=1e-12)


def test_a_reading_that_is_taken_out_again_leaves_no_trace():
    first, second, third = (evidence(np.array(one)) for one in ((0.6, 0.1, 0.3), (0.0, 0.9, 0.1), (0.4, 0.1, 0.5)))
    assert (first + second + third - second).belief() == pytest.approx((first + third).belief(), abs=1e-12)


@given(readings=st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=30, max_size=60))
@settings(max_examples=20, deadline=None)
def test_many_readings_still_make_a_belief(readings):
    masses = np.array([(o * (1 - f / 2), (1 - o) * f, 1 - o * (1 - f / 2) - (1 - o) * f) for o, f in readings])
    fused = fuse(masses)
    assert fused.min() >= -1e-9
    assert fused.sum() == pytest.approx(1)


def test_however_many_readings_touch_a_wall_it_stays_a_wall():
    # All agree, so nothing is shared out: m(occupied) is 1 - 0.1^5000.
    assert fuse(np.tile([0.9, 0, 0.1], (5000, 1)))[0] > 0.99


def test_of_thousands_of_readings_the_masses_that_each_set_was_given_tell_its_share():
    # Of many sources the sums of chosen masses are as good as certain: 3 to 1 in JAIF 16(1) 2021, Eq. 23-26.
    masses = np.tile([(0.9, 0, 0.1), (0.9, 0, 0.1), (0, 0.9, 0.1), (0.9, 0, 0.1)], (1250, 1))
    assert fuse(masses) == pytest.approx((0.75, 0.25, 0), abs=1e-3)


def test_beliefs_of_many_cells_are_fused_cell_by_cell():
    masses = np.random.default_rng(1).dirichlet((1, 1, 1), size=(3, 4, 5))
    for rule in get_args(Rule):
        assert fuse(masses, rule)[2, 3] == pytest.approx(fuse(masses[:, 2, 3], rule))


@pytest.mark.parametrize(
    ("masses", "rule", "complaint"),
    [
        ([(0.5, 0.5, 0.5)], "pcr6+", "sum to 1"),
        ([(1.2, -0.2, 0)], "pcr6+", "at least 0"),
        ([0.5, 0.5, 0], "pcr6+", "shape"),
        ([(1, 0, 0)], "yager", "no fusion rule"),
        ([(1, 0, 0)] * 11, "pcr5", "10 sources"),
        ([(1, 0, 0), (0, 1, 0)], "dempster", "contradict"),
    ],
)
def test_what_can_not_be_fused_is_refused_with_the_reason(masses, rule, complaint):
    with pytest.raises(ValueError, match=complaint):
        fuse(np.array(masses, float), rule)


def test_the_table_of_nodes_is_what_its_design_gives():
    count = min(COUNTS)
    assert np.concatenate(nodes(count)) == pytest.approx(np.concatenate(design(count)), rel=1e-3)


def test_thirty_two_nodes_share_any_product_to_a_millionth():
    t, w = nodes(32)
    sums = np.geomspace(LEAST_SUM, MOST_SUM, 20_000)
    error = np.abs(sums * (np.exp(-np.outer(sums, t)) @ w) - 1) * np.minimum(1, 10 * sums)
    assert error.max() < 1e-6
