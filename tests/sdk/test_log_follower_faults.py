"""A follower beside stores that fail, logs that do not answer, and records and names that nobody meant."""

import subprocess
import sys
import threading
from time import monotonic

import pytest
from sdk.followed import PATIENCE_S, LoggedUnit, SilentUnit, Store
from system.processes import wait_until

from noctule import bus, client, keys, log_follower
from noctule.errors import NoctuleError
from noctule.messages_pb2 import Reading, Sweep, UnitStatus


def test_a_status_that_names_a_unit_by_64_kb_ends_nothing(open_session, far, follow):
    """A key of 65,536 bytes makes Zenoh 1.10.2 panic, which is no Exception and breaks the session."""
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    follow(store)
    unit.sweep()
    store.wait_for(lambda stored: stored.of("u1") == [1])
    forged = UnitStatus(unit="x" * 65536, log_id="L", log_head=1)
    far.publish(keys.unit_status("room", "u2"), forged)
    unit.sweep()
    store.wait_for(lambda stored: stored.of("u1") == [1, 2])


def test_records_that_can_not_be_true_are_passed_over_and_counted(open_session, follow, caplog):
    """Beam 1e-300, angles 1.7e308 and 100,000 readings, the last as many as an attack had; two end the log."""
    unit, store = LoggedUnit(open_session(), "u1", lose=1.0), Store()
    unit.sweep(6)
    unit.sweeps[1].sensor.beam_width_rad = 1e-300
    unit.sweeps[2].readings.extend([Reading(bearing_rad=0.1)] * 100_000)
    unit.sweeps[4].pose.heading_rad = unit.sweeps[5].pose.heading_rad = 1.7e308
    follower = follow(store)
    store.wait_for(lambda stored: stored.of("u1") == [1, 4])
    unit.sweep(1)
    store.wait_for(lambda stored: stored.of("u1") == [1, 4, 7])
    assert follower.counters()["refused"] == 4
    assert follower.counters()["lost"] == 0
    assert "unit u1: 4 records of its log are refused and passed over, the first is 2: sensor.beam_width" in caplog.text


PANICKING = """
import sys, threading
from noctule import Client, LogFollower, threads
threads.end_process_when_one_fails()
client = Client("room", [sys.argv[1]])
follower = LogFollower(client, lambda sweeps: client.session.get("x" * 70_000), {})
follower.start()
threading.Event().wait()
"""


def test_a_panic_in_a_thread_ends_the_program_with_its_reason(open_session, router):
    unit = LoggedUnit(open_session(), "u1")
    unit.sweep()
    program = subprocess.run(
        [sys.executable, "-c", PANICKING, router.endpoint], timeout=240, capture_output=True, text=True, check=False
    )
    assert program.returncode == 70
    assert "noctule-follow-room failed, and with it the program" in program.stderr
    assert "PanicException" in program.stderr


def test_a_store_that_fails_gets_the_same_sweeps_again_and_meanwhile_nothing_moves(open_session, follow):
    failing = threading.Event()
    failing.set()
    failed = threading.Semaphore(0)
    store = Store(fail=lambda: failing.is_set() and (failed.release() or True))
    unit = LoggedUnit(open_session(), "u1")
    unit.sweep(5)
    follower = follow(store)
    for _ in range(3):
        assert failed.acquire(timeout=120)
    assert follower.cursors()["u1"].log_sequence == 0
    failing.clear()
    store.wait_for(lambda stored: stored.of("u1") == [1, 2, 3, 4, 5])
    assert follower.counters()["failed"] >= 3


def test_whose_log_can_not_be_read_and_why_is_told_as_long_as_it_can_not(open_session, follow):
    well, sick, store = LoggedUnit(open_session(), "u1"), LoggedUnit(open_session(), "u2"), Store()
    sick.trouble = "its disk is gone"
    follower = follow(store)
    well.sweep()
    wait_until(lambda: "u2" in follower.unread(), "it is not told")
    unread = follower.unread()
    assert list(unread) == ["u2"] and "its disk is gone" in unread["u2"]
    sick.trouble = ""
    wait_until(lambda: not follower.unread(), "it is still told")
    sick.sweep()
    store.wait_for(lambda stored: stored.of("u1") == stored.of("u2") == [1])


def test_a_log_that_nobody_serves_any_more_is_not_called_unreadable(open_session, follow):
    sick = LoggedUnit(open_session(), "u1")
    sick.trouble = "its disk is gone"
    follower = follow(Store())
    wait_until(lambda: "u1" in follower.unread(), "it is not told")
    sick.end()
    wait_until(lambda: not follower.unread(), "it is still told")


def test_a_store_that_fails_is_told_in_one_line_until_it_has_taken_something(open_session, follow, caplog):
    failing = threading.Event()
    failing.set()
    failed = threading.Semaphore(0)

    class Full(Store):
        def deliver(self, sweeps):
            if failing.is_set():
                failed.release()
                raise NoctuleError("the disk is full: make room")
            super().deliver(sweeps)

    store, unit = Full(), LoggedUnit(open_session(), "u1")
    follow(store)
    for times in (1, 2):
        unit.sweep()
        for _ in range(3):
            assert failed.acquire(timeout=PATIENCE_S)
        failing.clear()
        store.wait_for(lambda stored, times=times: len(stored.sweeps) == times)
        failing.set()
        told = [record for record in caplog.records if "the disk is full: make room" in record.getMessage()]
        assert len(told) == times
        assert not any(record.exc_info for record in told)


def test_a_store_that_fails_is_tried_later_and_later_though_sweeps_keep_coming(open_session, follow):
    failed_s = []
    session = open_session()
    unit = LoggedUnit(session, "u1", lose=1.0)
    unit.sweep(5)
    follow(Store(fail=lambda: failed_s.append(monotonic()) or True))
    live = bus.declare_publisher(session, keys.sweep("room", "u1"), Sweep)
    deadline_s = monotonic() + PATIENCE_S
    while len(failed_s) < 5:
        assert monotonic() < deadline_s, failed_s
        unit.sweep()
        live.put(unit.sweeps[-1].SerializeToString())
        threading.Event().wait(0.02)  # sweeps come fifty times a second
    assert failed_s[4] - failed_s[0] >= log_follower.FIRST_RETRY_S * (1 + 2 + 4 + 8)


def test_a_sweep_that_can_not_be_stored_holds_up_no_other_unit(open_session, follow):
    class Picky(Store):
        def deliver(self, sweeps):
            if sweeps[0].unit == "bad":
                raise ValueError("no such unit in the store")
            super().deliver(sweeps)

    session, store = open_session(), Picky()
    units = [LoggedUnit(session, name) for name in ("bad", "good")]
    follow(store)
    for _ in range(20):
        for unit in units:
            unit.sweep()
    store.wait_for(lambda stored: stored.of("good") == list(range(1, 21)))


@pytest.fixture
def waits_long(monkeypatch):
    """A question to a log that is silent takes longer than its test."""
    monkeypatch.setattr(client, "QUERY_TIMEOUT_S", 10 * PATIENCE_S)


@pytest.mark.usefixtures("waits_long")
@pytest.mark.parametrize("before", ["never asked", "answered", "not served"])
def test_a_unit_is_read_while_thirty_others_do_not_answer(open_session, follow, before):
    """With one question at a time, of 5 s each, this took minutes."""
    session, store = open_session(), Store()
    unit, names = LoggedUnit(session, "good"), [f"silent{number}" for number in range(30)]
    unit.sweep(3)
    if before == "answered":
        others = [LoggedUnit(session, name) for name in names]
    elif before == "not served":
        others = [session.liveliness().declare_token(keys.alive("room", name)) for name in names]
    else:
        others = []
    follower = follow(store, poll_s=3600.0)
    store.wait_for(lambda stored: stored.of("good") == [1, 2, 3])
    if others:
        wait_until(lambda: all(name in follower._units for name in names), "not all are met")
        wait_until(lambda: not any(each.asking for each in follower._units.values()), "not all are asked")
    for other in others:
        other.end() if isinstance(other, LoggedUnit) else other.undeclare()
    silent = [SilentUnit(session, name) for name in names]
    assert all(each.asked.acquire(timeout=PATIENCE_S) for each in silent)
    unit.sweep()
    store.wait_for(lambda stored: stored.of("good") == [1, 2, 3, 4])
    unit._lose = 1.0  # only the status says that there are more
    unit.sweep(700)
    unit.status()
    store.wait_for(lambda stored: stored.of("good") == list(range(1, 705)))


def test_what_a_stranger_publishes_is_never_delivered_and_the_units_own_sweeps_come(open_session, far, follow):
    """Before, a stranger's live sweeps that followed on were taken, durably, and the log's own were not."""
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    unit.sweep(4)
    follower = follow(store)
    store.wait_for(lambda stored: stored.of("u1") == [1, 2, 3, 4])
    for sequence in range(5, 9):
        forged = Sweep(site="room", unit="u1", log_id="a", log_sequence=sequence, waypoint=77)
        far.publish(keys.sweep("room", "u1"), forged)
    wait_until(lambda: follower.counters()["refused"] == 4, "they are not refused")
    assert store.cursors["u1"].log_sequence == 4
    unit.sweep(5)
    store.wait_for(lambda stored: len(stored.sweeps) == 9)
    assert store.sweeps == unit.sweeps
    assert (follower.counters()["lost"], follower.counters()["refused"]) == (0, 4)


def test_sweeps_that_a_stranger_makes_up_without_end_do_not_have_the_log_asked_without_end(open_session, follow):
    """A fake log that changed its id was asked 18,541 times in 15 s."""
    session, store = open_session(), Store()
    unit = LoggedUnit(session, "u1")
    unit.sweep()
    follower = follow(store)
    store.wait_for(lambda stored: stored.of("u1") == [1])
    asked, began_s, numbers = unit.asked, monotonic(), iter(range(2, 10_000))

    def many_are_refused():
        forged = Sweep(site="room", unit="u1", log_id="a", log_sequence=next(numbers))
        session.put(keys.sweep("room", "u1"), forged.SerializeToString())
        return follower.counters()["refused"] >= 100

    wait_until(many_are_refused, "they are not refused", PATIENCE_S, every_s=0.005)
    assert unit.asked - asked <= 2 + (monotonic() - began_s) / log_follower.FIRST_RETRY_S


def test_names_that_somebody_makes_up_without_end_are_refused_and_counted(open_session, follow, monkeypatch, caplog):
    monkeypatch.setattr(log_follower, "MAX_UNITS", 3)
    session, store = open_session(), Store()
    units = [LoggedUnit(session, f"u{number}") for number in range(3)]
    for unit in units:
        unit.sweep()
    follower = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 3)
    made_up = LoggedUnit(session, "made-up")
    made_up.sweep(5)
    units[0].sweep()
    store.wait_for(lambda stored: len(stored.of("u0")) == 2)
    wait_until(lambda: follower.counters()["refused"] >= 5, "the made-up unit's sweeps are not counted")
    assert store.of("made-up") == []
    assert caplog.text.count("more than 3 units: made-up is not read") == 1


def test_what_is_held_while_a_store_hangs_is_bounded_and_nothing_is_lost(open_session, follow, monkeypatch):
    most_bytes, longest_bytes = 150, 1000
    monkeypatch.setattr(log_follower, "MOST_BYTES", most_bytes)  # some of the twelve answers, which have 40 or more
    hangs, go_on = threading.Event(), threading.Event()
    go_on.set()

    class Hanging(Store):
        def deliver(self, sweeps):
            if not go_on.is_set():
                hangs.set()
                assert go_on.wait(PATIENCE_S)
            super().deliver(sweeps)

    session, store = open_session(), Hanging()
    units = [LoggedUnit(session, f"u{number}") for number in range(12)]
    for unit in units:
        unit.sweep()
    follower = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == len(units))
    go_on.clear()
    units[0].sweep()
    assert hangs.wait(PATIENCE_S)
    come = follower._client.counters()["delivered"]
    for unit in units:
        unit.sweep(20)
    wait_until(lambda: follower._client.counters()["delivered"] >= come + 12 * 20, "the sweeps don't come")

    def has_no_room():
        return [each for each in follower._units.values() if each.doubtful and not each.asking]

    wait_until(has_no_room, "all answers are held")
    assert follower._answer_bytes <= max(most_bytes, longest_bytes)

    def is_asked_later():
        for number, unit in enumerate(units):  # a sign that comes again has the log asked beside the store's thread
            session.put(keys.sweep("room", f"u{number}"), unit.sweeps[-1].SerializeToString())
        return any(each.asks.not_before_s - monotonic() > 3 * log_follower.FIRST_RETRY_S for each in has_no_room())

    wait_until(is_asked_later, "what has no room is asked again and again", every_s=0.02)
    go_on.set()
    store.wait_for(lambda stored: len(stored.sweeps) == 12 * 21 + 1)
    assert all(store.of(f"u{number}") == list(range(1, 22 + (number == 0))) for number in range(12))
    assert follower.counters()["lost"] == 0
