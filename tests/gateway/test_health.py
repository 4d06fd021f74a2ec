"""What a judge remembers, forgets and lets be: over restarts, recoveries and other poses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from gateway.health_rooms import COARSE_RAD, Stand, stand_of, sweep_of
from mapper.fixed_units import BEARINGS_RAD

from noctule import bounds
from noctule import messages_pb2 as messages
from noctule.messages_pb2 import Sweep
from noctule_gateway.health import memory_file
from noctule_gateway.health.dead_bearing import NAMED_AFTER
from noctule_gateway.health.judge import Judge
from noctule_gateway.health.readings import Readings

POSE = (1.0, 2.0, 0.5)
LEARNT_AFTER = 16
SILENCE = np.full(61, math.nan)


@pytest.fixture
def stand() -> Stand:
    return stand_of(1)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(1)


@pytest.fixture
def judge(stand: Stand, rng: np.random.Generator) -> Judge:
    """It has learnt what the unit hears."""
    judge = Judge()
    for number in range(LEARNT_AFTER):
        assert not judge.judge(sweep_of(stand.hears(rng), number), POSE).findings
    return judge


def kinds(judge: Judge) -> list[messages.FaultKind]:
    return [one.kind for one in judge.findings]


def named_as_turned(judge: Judge, stand: Stand, rng: np.random.Generator) -> Stand:
    """The unit's stand once it was turned by 9 degrees and the judge has said so."""
    turned = stand.turned(9.0)
    for number in range(4):
        judge.judge(sweep_of(turned.hears(rng), number), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_TURNED]
    return turned


def test_a_fault_is_over_after_three_well_sweeps_and_those_meanwhile_are_still_flagged(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    for number in range(3):
        judge.judge(sweep_of(SILENCE, number), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_SILENT]
    flagged = [bool(judge.judge(sweep_of(stand.hears(rng), number), POSE).spoiled_by) for number in range(4)]
    assert flagged == [True, True, False, False]


def test_the_sweep_that_names_a_fault_says_which_before_it_are_suspect(judge: Judge) -> None:
    verdicts = [judge.judge(sweep_of(SILENCE, number), POSE) for number in range(3)]
    # And the one in whose midst it may have begun.
    assert [one.suspect_before for one in verdicts] == [0, 2, 0]
    assert verdicts[1].findings[0].since_ns == sweep_of(SILENCE, 0).start_ns


def test_a_restart_forgets_neither_the_fault_nor_the_past(judge: Judge, stand: Stand, rng: np.random.Generator) -> None:
    turned = stand.turned(9.0)
    for number in range(4):
        judge.judge(sweep_of(turned.hears(rng), number), POSE)
    again = Judge(memory_file.from_text(memory_file.to_text(judge.memory)))
    assert again.findings == judge.findings != ()
    again.judge(sweep_of(turned.hears(rng), 4), POSE)
    assert kinds(again) == [messages.FAULT_KIND_TURNED]


def test_at_another_pose_of_the_site_file_the_past_begins_again(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    turned = named_as_turned(judge, stand, rng)
    for number in range(LEARNT_AFTER):
        assert not judge.judge(sweep_of(turned.hears(rng), number), (1.0, 2.0, 0.7)).findings


def test_a_thermometer_that_is_trimmed_starts_a_new_past(stand: Stand, rng: np.random.Generator) -> None:
    """At 29 degrees C ranges grow by 1.6 % once 20 are no longer assumed."""
    judge = Judge()
    for number in range(LEARNT_AFTER):
        judge.judge(sweep_of(stand.hears(rng), number, air_c=None), POSE)
    for number in range(LEARNT_AFTER):
        assert not judge.judge(sweep_of(1.016 * stand.hears(rng), number, air_c=29.0), POSE).findings
    assert judge.memory.past.air_measured


@pytest.mark.parametrize("share", [-0.025, -0.016, 0.016, 0.025])
def test_ranges_that_the_air_may_have_changed_are_no_fault_where_nobody_measures_it(
    stand: Stand, rng: np.random.Generator, share: float
) -> None:
    assumed, measured = Judge(), Judge()
    for number in range(LEARNT_AFTER):
        assumed.judge(sweep_of(stand.hears(rng), number, air_c=None), POSE)
        measured.judge(sweep_of(stand.hears(rng), number), POSE)
    for number in range(100):
        changed = sweep_of((1 + share) * stand.hears(rng), number, air_c=None)
        assert not assumed.judge(changed, POSE).findings, number
    for number in range(10):
        measured.judge(sweep_of((1 + share) * stand.hears(rng), number), POSE)
    assert kinds(measured) == [messages.FAULT_KIND_RANGES_JUMPED]


def test_ranges_four_percent_longer_are_a_fault_with_assumed_air_too(stand: Stand, rng: np.random.Generator) -> None:
    judge = Judge()
    for number in range(LEARNT_AFTER):
        judge.judge(sweep_of(stand.hears(rng), number, air_c=None), POSE)
    for number in range(3):
        judge.judge(sweep_of(1.04 * stand.hears(rng), number, air_c=None), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_RANGES_JUMPED]


@pytest.mark.parametrize("readings", [3, 30, 60])
def test_a_sweep_that_stop_has_cut_short_changes_nothing(
    judge: Judge, stand: Stand, rng: np.random.Generator, readings: int
) -> None:
    turned = named_as_turned(judge, stand, rng)
    past, since_ns = judge.memory.past, judge.findings[0].since_ns
    for number in range(4, 14):
        judge.judge(sweep_of(turned.hears(rng)[:readings], number, BEARINGS_RAD[:readings]), POSE)
        judge.judge(sweep_of(turned.hears(rng), number), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_TURNED]
    assert (judge.findings[0].since_ns, judge.memory.past) == (since_ns, past)


def test_a_second_sweep_of_another_plan_starts_a_new_past(judge: Judge, stand: Stand, rng: np.random.Generator) -> None:
    coarse = Stand(stand.room, stand.pose, COARSE_RAD)
    judge.judge(sweep_of(coarse.hears(rng), 0, COARSE_RAD), POSE)
    assert len(judge.memory.past.bearing_rad) == len(BEARINGS_RAD)
    judge.judge(sweep_of(coarse.hears(rng), 1, COARSE_RAD), POSE)
    assert judge.memory.past.bearing_rad == tuple(COARSE_RAD)


def test_a_cut_sweep_amid_those_that_show_a_fault_is_suspect_too(judge: Judge) -> None:
    judge.judge(sweep_of(SILENCE, 0), POSE)
    judge.judge(sweep_of(SILENCE[:10], 1, BEARINGS_RAD[:10]), POSE)
    verdict = judge.judge(sweep_of(SILENCE, 2), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_SILENT]
    assert verdict.suspect_before == 3


def test_of_a_fault_that_follows_another_only_its_own_sweeps_are_suspect(judge: Judge) -> None:
    for number in range(1200):
        judge.judge(failing(messages.READING_STATUS_NO_SENSOR, number), POSE)
    verdicts = [judge.judge(failing(messages.READING_STATUS_STUCK_HIGH, 1200 + number), POSE) for number in range(2)]
    assert kinds(judge) == [messages.FAULT_KIND_STUCK_HIGH]
    assert verdicts[1].suspect_before == 2
    assert judge.findings[0].since_ns == sweep_of(SILENCE, 1200).start_ns


def test_suspect_sweeps_are_never_more_than_a_record_may_say(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    judge.judge(failing(messages.READING_STATUS_NO_SENSOR, 0), POSE)
    for number in range(1, 1200):  # cut ones end no streak
        readings = 3 + number % 2
        judge.judge(sweep_of(stand.hears(rng)[:readings], number, BEARINGS_RAD[:readings]), POSE)
    verdict = judge.judge(failing(messages.READING_STATUS_NO_SENSOR, 1200), POSE)
    assert verdict.suspect_before == bounds.MOST_SUSPECT
    bounds.check(Sweep(faults=verdict.spoiled_by, suspect_before=verdict.suspect_before))


def test_a_fixed_unit_that_is_carried_now_has_no_faults_of_its_place(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    turned = named_as_turned(judge, stand, rng)
    assert not judge.judge(sweep_of(turned.hears(rng), 4, fixed=False), ()).findings


def test_one_bearing_that_never_answers_again_is_named_and_spoils_no_sweep(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    heard = np.array(np.isfinite(stand.clear_m).all(axis=0))
    between = [n for n in range(1, 60) if heard[n - 1 : n + 2].all() and np.ptp(stand.clear_m[:, n - 1 : n + 2]) < 0.02]
    for number in range(3 * NAMED_AFTER):
        range_m = stand.hears(rng)
        range_m[between[0]] = math.nan
        verdict = judge.judge(sweep_of(range_m, number), POSE)
        if verdict.findings:
            break
    assert number + 1 >= NAMED_AFTER
    assert (kinds(judge), verdict.spoiled_by) == ([messages.FAULT_KIND_BEARING_SILENT], ())


def test_an_accepted_room_is_learnt_and_what_changes_in_it_then_is_named(
    judge: Judge, stand: Stand, rng: np.random.Generator
) -> None:
    turned = named_as_turned(judge, stand, rng)
    judge.accept_room()
    for number in range(LEARNT_AFTER):
        verdict = judge.judge(sweep_of(turned.hears(rng), number), POSE)
        assert (verdict.findings, verdict.spoiled_by, verdict.suspect_before) == ((), (), 0)
    for number in range(5):
        judge.judge(sweep_of(stand.hears(rng), LEARNT_AFTER + number), POSE)
    assert kinds(judge) == [messages.FAULT_KIND_TURNED]


def failing(status: messages.ReadingStatus, number: int) -> Readings:
    return replace(sweep_of(SILENCE, number), status=(status,) * len(SILENCE))
