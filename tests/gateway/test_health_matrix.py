"""Each fault in twenty rooms is named in time and never wrongly; sound units raise no alarm."""

import copy
from functools import cache

import numpy as np
import pytest
from gateway.health_faults import FAULTS, FROM_A_SWEEPS_BEGINNING, Sweeps
from gateway.health_rooms import Stand, look, marks_in, stand_of

from noctule.messages_pb2 import FaultKind
from noctule_gateway.health.judge import Judge

SEEDS = 20
LEARNT_AFTER = 16  # sweeps
PLACE = (0.0, 0.0, 0.0)
LEAST_MARKS = 4  # below, a motion can't be told from a change of the room: gateway/README.md, "Health"


@cache
def unit(seed: int) -> tuple[Stand, Judge]:
    """A unit in the ``seed``-th room where it hears four reflectors, and what its gateway has learnt of it."""
    stand = [one for one in map(stand_of, range(2 * SEEDS)) if marks_in(one) >= LEAST_MARKS][seed]
    judge, rng = Judge(), np.random.default_rng(seed)
    for number in range(LEARNT_AFTER):
        assert not judge.judge(look(stand.hears(rng), number), PLACE).findings
    return stand, judge


def begun_within(stand: Stand, rng: np.random.Generator, faulty: Sweeps) -> Sweeps:
    """The fault begins in the midst of the first sweep."""
    cut = int(rng.integers(0, len(stand.bearings_rad)))

    def sweep(number: int) -> np.ndarray:
        range_m = faulty(number)
        return range_m if number else np.concatenate([stand.hears(rng)[:cut], range_m[cut:]])

    return sweep


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_in_time_and_never_wrongly(name: str) -> None:
    make, kind, named_by = FAULTS[name]
    late, wrong = [], []
    for seed in range(SEEDS):
        stand, learnt = unit(seed)
        judge, rng = copy.deepcopy(learnt), np.random.default_rng(1000 + seed)
        faulty = make(stand, rng)
        if name not in FROM_A_SWEEPS_BEGINNING:
            faulty = begun_within(stand, rng, faulty)
        named = None
        for number in range(named_by + 2):
            verdict = judge.judge(look(faulty(number), LEARNT_AFTER + number), PLACE)
            for finding in verdict.findings:
                if finding.kind != kind:
                    wrong.append((seed, number + 1, FaultKind.Name(finding.kind), finding.words))
                elif named is None:
                    named = number + 1
        if named is None or named > named_by:
            late.append((seed, named))
    assert (late, wrong) == ([], [])
