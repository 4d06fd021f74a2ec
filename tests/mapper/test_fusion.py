"""Fusion of beliefs, against the figures that the papers print, an independent library, and the sum written out."""

from itertools import permutations, product
from typing import get_args

import mpmath
import numpy as np
import pytest
from evidencelib import Frame, MassFunction
from hypothesis import given, settings
from hypothesis import strategies as st

from noctule_mapper.choices import Rule
from noctule_mapper.fusion import FusionError, conflict, fuse

FRAME, FREE_MODEL = Frame.dst(["O", "F"]), Frame.dsmt(["O", "F"])
HARD_MASSES = (0, 1e-6, 1e-3, 0.5, 1 - 1e-6, 1)
HARD_BELIEFS = np.array([(o, f, max(0, 1 - o - f)) for o in HARD_MASSES for f in HARD_MASSES if o + f <= 1 + 1e-12])
LIBRARY = {
    "pcr6+": lambda first, *others: first.pcr6_plus(*others),
    "pcr6": lambda first, *others: first.pcr6(*others),
    "pcr5": lambda first, *others: first.pcr5(*others),
    "pcr2": lambda first, *others: first.pcr2(*others),
    "dempster": lambda first, *others: first.dempster(*others),
    "dsmc": lambda first, *others: first.dsmc(*others),
}


@st.composite
def beliefs(draw: st.DrawFn, most: int = 5) -> np.ndarray:
    """Two to ``most`` beliefs, (sources, 3)."""
    part = st.tuples(*[st.floats(0.02, 1)] * 3)
    raw = np.array(draw(st.lists(part, min_size=2, max_size=most)))
    return raw / raw.sum(axis=1, keepdims=True)


PAIR_1 = [(0.6, 0, 0.4), (0, 0.3, 0.7)]
PAIR_2 = [(0.6, 0, 0.4), (0.2, 0.3, 0.5)]
PAIR_3 = [(0.6, 0.3, 0.1), (0.2, 0.3, 0.5)]
PAIR_4 = [(0.7, 0.1, 0.2), (0.5, 0.4, 0.1)]
THREE = [*PAIR_3, (0.4, 0.4, 0.2)]
CERTAIN = [(1, 0, 0), (0, 1, 0), (0, 1, 0)]
JAIF_2 = [(0.6, 0.1, 0.3), (0.5, 0.3, 0.2), (0.4, 0.1, 0.5)]


@pytest.mark.parametrize(
    ("rule", "sources", "figures"),
    [
        # Smarandache & Dezert, arXiv cs/0408064, sections 11.1.1 to 11.1.3, 12.2 and 11.4; PCR5 and PCR6 are one rule
        # for two sources. Computed by several libraries, not printed: Dempster of 11.1.1, PCR2 of 11.1.2 and 11.1.3,
        # all of 11.4.
        ("pcr5", PAIR_1, (0.54, 0.18, 0.28)),
        ("pcr6", PAIR_1, (0.54, 0.18, 0.28)),
        ("pcr2", PAIR_1, (0.54, 0.18, 0.28)),
        ("dempster", PAIR_1, (0.512195, 0.146341, 0.341463)),
        ("pcr5", PAIR_2, (0.62, 0.18, 0.20)),
        ("pcr6", PAIR_2, (0.62, 0.18, 0.20)),
        ("pcr2", PAIR_2, (0.630909, 0.169091, 0.2)),
        ("pcr5", PAIR_3, (0.584, 0.366, 0.05)),
        ("pcr6", PAIR_3, (0.584, 0.366, 0.05)),
        ("pcr2", PAIR_3, (0.577143, 0.372857, 0.05)),
        ("dempster", PAIR_3, (0.579, 0.355, 0.066)),
        ("pcr2", PAIR_4, (0.752941, 0.227059, 0.02)),
        ("pcr5", PAIR_4, (0.739849, 0.240151, 0.02)),
        ("pcr6", PAIR_4, (0.739849, 0.240151, 0.02)),
        ("dempster", PAIR_4, (0.776119, 0.194030, 0.029851)),
        ("pcr6", THREE, (0.539699, 0.372684, 0.087617)),
        ("pcr2", THREE, (0.569818, 0.420182, 0.01)),
        # Martin & Osswald 2006, section 3: A, B, B, all certain.
        ("pcr6", CERTAIN, (1 / 3, 2 / 3, 0)),
        ("pcr6+", CERTAIN, (1 / 3, 2 / 3, 0)),
        # Dezert, Dambreville & Smarandache, JAIF 16(1), 2021, example 2.
        ("pcr6", JAIF_2, (0.743496, 0.162245, 0.094259)),
        ("pcr6+", JAIF_2, (0.788847, 0.181153, 0.03)),
    ],
)
def test_a_rule_gives_the_papers_figures(rule, sources, figures):
    digits = 5e-4 if figures == (0.579, 0.355, 0.066) else 1e-6  # the one that is printed to three
    assert fuse(np.array(sources, float), rule) == pytest.approx(figures, abs=digits)


@pytest.mark.parametrize("rule", LIBRARY)
@given(masses=beliefs(most=4))
@settings(max_examples=30)
def test_every_rule_agrees_with_an_independent_library(rule, masses):
    frame = FREE_MODEL if rule == "dsmc" else FRAME
    functions = [MassFunction(frame, {"O": o, "F": f, "O|F": u}, tolerance=1e-6) for o, f, u in masses]
    expected = LIBRARY[rule](*functions)
    assert fuse(masses, rule) == pytest.approx([expected.mass(key) for key in ("O", "F", "O|F")], abs=1e-6)


@given(masses=beliefs(most=4))
@settings(max_examples=30)
def test_conflict_is_what_the_classic_dsm_rule_gives_to_occupied_and_free(masses):
    functions = [MassFunction(FREE_MODEL, {"O": o, "F": f, "O|F": u}, tolerance=1e-6) for o, f, u in masses]
    both = functions[0].dsmc(*functions[1:]).mass("O&F")
    assert conflict(masses) == pytest.approx(both, abs=1e-9)
    assert fuse(masses, "dsmc").sum() + conflict(masses) == pytest.approx(1)


@pytest.mark.parametrize("rule", ["pcr6+", "pcr6"])
@given(masses=beliefs(most=7))
@settings(max_examples=40)
def test_an_integral_gives_the_sum_over_all_products_to_a_millionth(rule, masses):
    assert fuse(masses, rule) == pytest.approx(written_out(masses, rule), abs=1e-6)


@pytest.mark.parametrize("rule", ["pcr6+", "pcr6"])
@given(chosen=st.lists(st.sampled_from(range(len(HARD_BELIEFS))), min_size=2, max_size=7))
@settings(max_examples=60)
def test_certain_and_tiny_masses_are_fused_to_a_millionth_too(rule, chosen):
    masses = HARD_BELIEFS[chosen]
    assert fuse(masses, rule) == pytest.approx(written_out(masses, rule), abs=1e-6)


def written_out(masses: np.ndarray, rule: str) -> np.ndarray:
    """All 3^s products on this frame. PCR6+ (JAIF 16(1) 2021, Eq. 23-26) shares each by the masses that chose O and F;
    PCR6 (Martin & Osswald 2006) those in conflict, by all masses chosen.
    """
    choices = np.array(list(product(range(3), repeat=len(masses))))
    chosen = masses[np.arange(len(masses)), choices]
    weight = np.stack([np.where(choices == set_, chosen, 0).sum(axis=1) for set_ in range(3)])
    speaks = np.stack([(choices == set_).any(axis=1) for set_ in range(3)])
    if rule == "pcr6+":
        weight[2] = ~(speaks[0] | speaks[1])  # the unknown keeps only what nobody contradicts
    else:
        agreed = ~(speaks[0] & speaks[1])
        weight[:, agreed] = np.stack([speaks[0], speaks[1], ~(speaks[0] | speaks[1])])[:, agreed]
    total = weight.sum(axis=0)
    return (chosen.prod(axis=1) * weight / np.where(total > 0, total, 1)).sum(axis=1)


def mixed_masses(number: int) -> np.ndarray:
    """64 sources: as they come, small, nearly certain, with doubt of every size, hard ones."""
    rng = np.random.default_rng(number)
    kind = number % 5
    if kind == 0:
        return rng.dirichlet((1, 1, 1), size=64)
    if kind == 1:
        small = 10 ** rng.uniform(-6, -1, (64, 2))
        return np.column_stack([small, 1 - small.sum(axis=1)])
    if kind == 2:
        return rng.dirichlet((0.1, 0.1, 0.01), size=64)
    if kind == 3:
        same = np.where(np.arange(64)[:, None] % 2, (0.013, 0.0), (0.0, 0.008))
        return np.column_stack([same, 1 - same.sum(axis=1)])
    return HARD_BELIEFS[rng.integers(len(HARD_BELIEFS), size=64)]


@pytest.mark.parametrize("number", range(10))
def test_sixty_four_sources_are_fused_to_a_millionth(number):
    masses = mixed_masses(number)
    assert fuse(masses)[0] == pytest.approx(integrated(masses), abs=1e-6)


def integrated(masses: np.ndarray) -> float:
    """m(O) by the integral of 1/S = integral of exp(-S t), t = exp(v), on a grid so fine that it errs by less than
    1e-9, in 30 digits.
    """
    with mpmath.workdps(30):
        rows = [[mpmath.mpf(float(m)) for m in row] for row in masses]

        def integrand(t: mpmath.mpf) -> mpmath.mpf:
            before, share = mpmath.mpf(1), mpmath.mpf(0)
            for o, f, u in rows:  # theory: N <- N G + o^2 exp(-t o) A, then A <- A G
                decayed = mpmath.exp(-t * o)
                g = o * decayed + f * mpmath.exp(-t * f) + u
                before, share = before * g, share * g + o * o * decayed * before
            return share * t

        step = mpmath.mpf(1) / 4
        return float(step * mpmath.fsum(integrand(mpmath.exp(step * k)) for k in range(-120, 100)))


def test_the_order_of_readings_does_not_matter():
    masses = np.array([(1.0, 0, 0), (0, 1, 0), (0, 0.7, 0.3), (0.2, 0.1, 0.7)])
    results = np.array([fuse(np.array(order)) for order in permutations(masses)])
    assert np.ptp(results, axis=0).max() < 1e-12


def test_a_reading_that_knows_nothing_changes_nothing():
    masses = np.array([(0.6, 0.1, 0.3), (0.5, 0.3, 0.2)])
    assert fuse(np.vstack([masses, [(0, 0, 1)]])) == pytest.approx(fuse(masses), abs=1e-12)


@given(readings=st.lists(st.tuples(st.floats(0, 1), st.floats(0, 1)), min_size=30, max_size=60))
@settings(max_examples=20)
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
def test_what_cannot_be_fused_is_refused_with_the_reason(masses, rule, complaint):
    with pytest.raises(FusionError, match=complaint):
        fuse(np.array(masses, float), rule)
