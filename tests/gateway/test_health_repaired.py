"""A unit that was repaired is as sound as any other: someone in the room does not bring its old fault back."""

import math

import numpy as np
import pytest
from gateway.health_faults import Make, moved, ranges
from gateway.health_rooms import Noise, Stand, marks_in, noisy, stand_of, sweep_of

from noctule import messages_pb2 as messages
from noctule_gateway.health.judge import Judge
from noctule_gateway.health.likelihood import shifted_nats, stay_fit
from noctule_gateway.health.past import Past

POSE = (0.0, 0.0, 0.0)
LEARNT_AFTER, FAULTY, SOUND, CROWDED = 16, 6, 8, 12  # sweeps
LEAST_MARKS = 4  # tests/gateway/test_health_matrix.py
ROOMS = range(100, 116)


def with_someone(stand: Stand, rng: np.random.Generator) -> np.ndarray:
    """Ranges of a sweep in which someone 0.4 to 1.5 m away hides 3 to 8 bearings, (n,)."""
    range_m, wide = stand.hears(rng), int(rng.integers(3, 9))
    first = int(rng.integers(0, len(range_m) - wide))
    range_m[first : first + wide] = noisy(np.full(wide, rng.uniform(0.4, 1.5)), rng, Noise())
    return range_m


@pytest.mark.parametrize(
    ("make", "kind"),
    [(ranges(1.03), messages.FAULT_KIND_RANGES_JUMPED), (moved(0.04), messages.FAULT_KIND_MOVED)],
    ids=["ranges 3 % longer", "moved 4 cm"],
)
def test_someone_in_the_room_does_not_bring_a_repaired_fault_back(make: Make, kind: messages.FaultKind) -> None:
    named, alarms = 0, []
    for seed in ROOMS:
        stand, judge, rng = stand_of(seed), Judge(), np.random.default_rng(seed)
        if marks_in(stand) < LEAST_MARKS:
            continue
        for number in range(LEARNT_AFTER):
            judge.judge(sweep_of(stand.hears(rng), number), POSE)
        faulty = make(stand, rng)
        for number in range(FAULTY):
            judge.judge(sweep_of(faulty(number), number), POSE)
        named += [one.kind for one in judge.findings] == [kind]
        for number in range(SOUND):
            judge.judge(sweep_of(stand.hears(rng), number), POSE)
        for number in range(CROWDED):
            judge.judge(sweep_of(with_someone(stand, rng), number), POSE)
            alarms += [(seed, number, one.words) for one in judge.findings]
    assert named >= 10  # of the eleven rooms with marks enough
    assert alarms == []


def test_ranges_that_are_longer_by_nothing_explain_nothing_even_where_the_past_heard_nothing() -> None:
    past = Past((0.0, 0.1), rows=[(1.0, math.nan)] * 8)
    sweep = sweep_of(np.array([1.0, 2.0]), 0, np.array([0.0, 0.1]))
    nothing = shifted_nats(sweep, past, lambda _direction_rad, range_m: 0.0 * range_m)
    assert nothing == pytest.approx(stay_fit(sweep, past) * 2)
