"""What a judge remembers, forgets and lets be: over restarts, recoveries, other poses, sweeps that come twice."""

import json
import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zenoh
from gateway.health_rooms import COARSE_RAD, Stand, stand_of, sweep_of
from gateway.model_unit import ModelUnit
from gateway.serving import FIXED, SITE, connected, running, site_file
from gateway.tcp_unit import tcp_unit
from mapper.fixed_units import BEARINGS_RAD
from system.processes import wait_until

from noctule import bounds
from noctule import messages_pb2 as messages
from noctule.client import Client
from noctule.faults import sentence
from noctule.messages_pb2 import CommandRequest, Sweep
from noctule.site import Unit, load
from noctule_gateway.errors import CommandError
from noctule_gateway.health import judge as judging
from noctule_gateway.health import memory_file
from noctule_gateway.health.dead_bearing import NAMED_AFTER
from noctule_gateway.health.judge import Judge, Memory
from noctule_gateway.health.readings import Readings
from noctule_gateway.unit.sweep_health import SweepHealth

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
        range_m = (1 + share) * stand.hears(rng)
        assert not assumed.judge(sweep_of(range_m, number, air_c=None), POSE).findings, number
        measured.judge(sweep_of(range_m, number), POSE)
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


WELL = {
    "version": 2,
    "place": [],
    "bearing_rad": [0.1],
    "skipped": 0,
    "air_measured": True,
    "rows": [[1.5], [None]],
    "usual": [-2.5],
}
FOUND = [int(messages.FAULT_KIND_TURNED), 5, "e1", 0.5, "turned", 0]


def memory(**other: object) -> str:
    return memory_file.sealed(json.dumps({**WELL, "findings": [FOUND], **other}))


def found(number: int, value: object) -> str:
    """A memory in which that part of the finding is another."""
    return memory(findings=[[*FOUND[:number], value, *FOUND[number + 1 :]]])


def test_a_file_that_is_a_memory_is_read(tmp_path: Path) -> None:
    (tmp_path / "u1.health").write_text(memory())
    (fault,) = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite").faults("e1")
    assert (fault.kind, fault.since.ToNanoseconds(), fault.confidence) == (messages.FAULT_KIND_TURNED, 5, 0.5)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        json.dumps({**WELL, "findings": [FOUND]}),
        memory().replace("turned", "burned"),
        memory()[:-5],
        *map(memory_file.sealed, ("", "{}", "[1]", "1", '{"version": 2}')),
        memory(version=1),
        memory(bearing_rad=[]),
        memory(bearing_rad=["0.1"]),
        memory(rows=[[math.inf]]),
        memory(rows=[["1.5"]]),
        memory(rows=[[10**400]]),
        memory(skipped=10**400),
        memory(usual=[math.nan]),
        memory(place="abc"),
        memory(findings=[[]]),
        memory(findings=[FOUND[:3]]),
        memory(findings=[[[]]]),
        memory(findings=5),
        *(found(1, value) for value in ("x", 1.5, -1, 10**400, 10**19, None)),
        found(2, 5),
        *(found(3, value) for value in ("0.5", 1.5, -0.1, math.nan, 10**400, None)),
        found(4, 5),
        found(5, "x"),
    ],
)
def test_a_file_that_is_no_memory_is_replaced(tmp_path: Path, text: str, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "u1.health").write_text(text)
    with pytest.raises(ValueError):
        memory_file.read(tmp_path / "u1.health")
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    assert health.faults("e1") == []
    assert "can't be read; the gateway learns again what the unit hears" in caplog.text


def test_where_there_is_no_file_nothing_is_known(tmp_path: Path) -> None:
    assert len(memory_file.read(tmp_path / "u1.health").past) == len(Memory().past) == 0


def test_a_sweep_that_comes_again_is_judged_as_it_was_and_counts_once(tmp_path: Path) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    for sequence in (1, 2, 2, 2, 3, 3, 4):
        message = Sweep(unit="u1", boot=1, sequence=sequence, readings=[no_sensor(n) for n in range(13)])
        health.judge(message, bytes([sequence]))
        assert list(message.faults) == ([messages.FAULT_KIND_NO_SENSOR] if sequence >= 2 else [])
        assert message.suspect_before == (2 if sequence == 2 else 0)
    assert health.flagged == 3
    (fault,) = health.faults("")
    assert fault.kind == messages.FAULT_KIND_NO_SENSOR


def test_a_memory_that_could_not_be_written_is_written_with_the_next_sweep(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    (tmp_path / "u1.health-new").mkdir()  # in its way
    for sequence in range(2):
        health.judge(Sweep(sequence=sequence, readings=[no_sensor(n) for n in range(13)]), bytes([sequence]))
    first = health.memory()
    assert first is not None
    health.save(first)
    assert "the health file can't be written; after a restart the gateway learns again" in caplog.text
    (tmp_path / "u1.health-new").rmdir()
    second = health.memory()
    assert second is not None and second == first
    health.save(second)
    assert health.memory() is None
    assert [one.kind for one in memory_file.read(tmp_path / "u1.health").findings] == [messages.FAULT_KIND_NO_SENSOR]


def test_since_when_is_left_open_where_the_clock_has_been_set_since(tmp_path: Path) -> None:
    health = SweepHealth(unit(tmp_path), "attic", tmp_path / "u1.sqlite")
    for sequence in range(2):
        readings = [no_sensor(n) for n in range(13)]
        health.judge(Sweep(sequence=sequence, clock_epoch="e1", readings=readings), bytes([sequence]))
    (before,), (after,) = health.faults("e1"), health.faults("e2")
    assert before.HasField("since") and "(since 1970-01-01 00:00 UTC, " in sentence(before)
    assert not after.HasField("since") and "(since before the clock was set, " in sentence(after)


def test_a_room_that_was_changed_is_accepted_by_a_command_and_stays_so_over_a_restart(
    tmp_path: Path, router: zenoh.Session
) -> None:
    (tmp_path / "u1.health").write_text(
        memory(findings=[FOUND, [int(messages.FAULT_KIND_REPEATS), 5, "e1", 0.5, "x", 0]])
    )
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            before = client.command("u1", "status", CommandRequest(), timeout_s=10)
            reply = client.command("u1", "accept_room", CommandRequest(), timeout_s=10)
            kept = memory_file.read(tmp_path / "u1.health")
    assert [one.kind for one in before.status.faults] == [messages.FAULT_KIND_REPEATS, messages.FAULT_KIND_TURNED]
    assert reply.done and [one.kind for one in reply.status.faults] == [messages.FAULT_KIND_REPEATS]
    assert len(kept.past) == 0 and [one.kind for one in kept.findings] == [messages.FAULT_KIND_REPEATS]
    given, done = [json.loads(line) for line in (tmp_path / "audit-1.jsonl").read_text().splitlines()[1:]]
    assert [(each["event"], each["command"]) for each in (given, done)] == [
        ("given", "accept_room"),
        ("done", "accept_room"),
    ]


def test_a_room_that_the_disk_does_not_keep_as_accepted_is_told_as_an_error(
    tmp_path: Path, router: zenoh.Session
) -> None:
    (tmp_path / "u1.health").write_text(memory(findings=[FOUND]))
    (tmp_path / "u1.health-new").mkdir()  # in its way
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            wait_until(lambda: connected(client), "the unit was not connected")
            refused = client.command("u1", "accept_room", CommandRequest(), timeout_s=10)
            (tmp_path / "u1.health-new").rmdir()
            kept = client.command("u1", "accept_room", CommandRequest(), timeout_s=10)
    assert not refused.done and "accepted, but the disk does not take that" in refused.error
    assert kept.done and memory_file.read(tmp_path / "u1.health").findings == ()


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


def test_the_room_of_a_carried_unit_is_not_to_be_accepted(tmp_path: Path) -> None:
    carried = load(site_file(tmp_path, ("u1", 1, "socket://127.0.0.1:1", 'pose = "key"'))).unit("u1")
    with pytest.raises(CommandError, match="the unit is carried"):
        SweepHealth(carried, "attic", tmp_path / "u1.sqlite").accept_room()


def test_a_judge_that_fails_keeps_no_sweep_from_the_log_and_is_told_once(
    tmp_path: Path, router: zenoh.Session, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise IndexError("a detector")

    monkeypatch.setattr(judging.silence, "suspicions", fails)
    with tcp_unit(ModelUnit(7, born_s=time.monotonic())) as line:
        path = site_file(tmp_path, ("u1", 7, line.address, FIXED))
        got: list[Sweep] = []
        with running(path, tmp_path, router), Client(SITE, session=router) as client:
            client.on_sweep(got.append)
            wait_until(lambda: connected(client), "the unit was not connected")
            with line.lock:
                for _ in range(2):
                    line.unit.make_sweep(time.monotonic())
            wait_until(lambda: len(got) == 2, "no sweep was committed")
            wait_until(lambda: not line.unit.ring, "no sweep was acknowledged")
    assert caplog.text.count("u1: a sweep could not be judged; it is kept unjudged") == 1


def failing(status: messages.ReadingStatus, number: int) -> Readings:
    return replace(sweep_of(SILENCE, number), status=(status,) * len(SILENCE))


def no_sensor(number: int) -> messages.Reading:
    return messages.Reading(bearing_rad=0.1 * number, status=messages.READING_STATUS_NO_SENSOR)


def unit(folder: Path) -> Unit:
    return load(site_file(folder, ("u1", 1, "socket://127.0.0.1:1", FIXED))).unit("u1")
