"""A follower has every sweep once, through dead routers, lost publications, failing stores and restarts."""

import random
import subprocess
import sys
import threading
from time import monotonic

import pytest
from sdk.followed import PATIENCE_S, LoggedUnit, RouterProcess, SilentUnit, Store
from system.processes import wait_until

from noctule import Client, LogFollower, bus, keys, log_follower
from noctule.client import QUERY_TIMEOUT_S
from noctule.errors import NoctuleError
from noctule.messages_pb2 import Cursor, Reading, Sweep, UnitStatus

POLL_S = 0.3  # so that a test in which all signs are lost need not wait for the usual ten seconds


@pytest.fixture
def router(endpoint):
    router = RouterProcess(endpoint)
    yield router
    router.stop()


@pytest.fixture
def follow(open_session):
    """Starts a follower with a client of its own that stores into a store; returns it."""
    running = []

    def start(store, poll_s=POLL_S):
        client = Client("room", session=open_session())
        follower = LogFollower(client, store.deliver, dict(store.cursors), poll_s)
        follower.start()
        running.append((follower, client))
        return follower

    yield start
    for follower, client in running:
        follower.close()
        client.close()


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
        [sys.executable, "-c", PANICKING, router.endpoint], timeout=60, capture_output=True, text=True, check=False
    )
    assert program.returncode == 70
    assert "noctule-follow-room failed, and with it the program" in program.stderr
    assert "PanicException" in program.stderr


def test_what_was_logged_before_and_after_the_start_comes_in_order(open_session, follow):
    unit = LoggedUnit(open_session(), "u1")
    unit.sweep(1200)
    store = Store()
    follower = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 1200)
    unit.sweep(30)
    store.wait_for(lambda stored: len(stored.sweeps) == 1230)
    assert store.sweeps == unit.sweeps
    assert follower.cursors()["u1"] == Cursor(unit="u1", log_id="a", log_sequence=1230)


def test_a_restarted_follower_goes_on_at_its_cursor(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    unit.sweep(10)
    first = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 10)
    first.close()
    unit.sweep(10)
    second = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 20)
    assert store.of("u1") == list(range(1, 21))
    assert second.counters()["delivered"] == 10


def test_a_status_tells_of_sweeps_whose_publication_was_lost(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1", lose=1.0), Store()
    follow(store, poll_s=3600.0)
    unit.sweep(5)
    unit.status()
    store.wait_for(lambda stored: stored.of("u1") == [1, 2, 3, 4, 5])


def test_sweeps_are_found_when_every_sign_of_them_was_lost(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1", lose=1.0), Store()
    follow(store)
    unit.sweep(2)
    store.wait_for(lambda stored: stored.of("u1") == [1, 2])
    unit.sweep(2)
    store.wait_for(lambda stored: stored.of("u1") == [1, 2, 3, 4])


def test_a_log_whose_end_a_status_tells_is_not_asked_for_it(open_session, follow):
    told, silent = LoggedUnit(open_session(), "u1"), LoggedUnit(open_session(), "u2")
    store = Store()
    for unit in (told, silent):
        unit.sweep(2)
    follow(store)
    store.wait_for(lambda store: store.of("u1") == store.of("u2") == [1, 2])

    def spared() -> bool:
        """Whether the log with statuses was asked less than half as often as the other, which was asked six times."""
        before = told.asked, silent.asked

        def polled():
            told.status()
            return silent.asked - before[1] >= 6

        wait_until(polled, "the log is not polled", every_s=POLL_S / 20)
        return told.asked - before[0] <= 3

    assert any(spared() for _ in range(5))  # statuses too may come late on a loaded machine
    told.sweep()
    told.status()
    store.wait_for(lambda store: store.of("u1") == [1, 2, 3])


def test_a_log_that_has_gone_back_is_found_though_statuses_come(open_session, follow, caplog):
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    unit.sweep(5)
    follow(store)
    store.wait_for(lambda stored: stored.of("u1") == [1, 2, 3, 4, 5])
    del unit.sweeps[3:]

    def is_found():
        unit.status()
        return "ends at 3 and was read to 5" in caplog.text

    wait_until(is_found, "nobody notices", 60, every_s=POLL_S / 20)


def test_a_log_that_refuses_its_questions_is_asked_later_and_later_though_statuses_come(open_session, follow):
    session, asked, told = open_session(), [], []
    queryable = session.declare_queryable(keys.log("room", "u1"), lambda query: (asked.append(1), query.drop()))
    follow(Store(), poll_s=3600.0)
    status = bus.StatePublisher(session, keys.unit_status("room", "u1"), UnitStatus)

    def many_are_told():
        status.put(UnitStatus(unit="u1", log_id="a", log_head=1, log_tail=1))
        told.append(1)
        return len(told) >= 100

    wait_until(many_are_told, "", PATIENCE_S, every_s=0.02)
    assert 1 <= len(asked) <= 20  # after 0.1 s, 0.2 s and so on up to 10 s: 12 in a minute
    queryable.undeclare()
    status.close()


def test_a_unit_that_appears_later_is_read(open_session, follow):
    store = Store()
    follow(store, poll_s=3600.0)
    LoggedUnit(open_session(), "u7").sweep(3)
    store.wait_for(lambda stored: stored.of("u7") == [1, 2, 3])


def test_what_the_log_removed_while_nobody_read_is_counted_as_lost(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1", keep=20), Store()
    unit.sweep(10)
    first = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 10)
    first.close()
    unit.sweep(50)
    second = follow(store)
    store.wait_for(lambda stored: stored.of("u1")[-1] == 60)
    assert store.of("u1") == [*range(1, 11), *range(41, 61)]
    assert second.counters()["lost"] == 30


def test_a_new_log_is_read_from_its_beginning(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    follow(store)
    unit.sweep(5)
    store.wait_for(lambda stored: len(stored.sweeps) == 5)
    unit.begin_log("b")
    unit.sweep(3)
    store.wait_for(lambda stored: len(stored.sweeps) == 8)
    assert [(sweep.log_id, sweep.log_sequence) for sweep in store.sweeps[5:]] == [("b", 1), ("b", 2), ("b", 3)]


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


def test_a_unit_is_read_live_and_from_its_log_while_thirty_others_do_not_answer(open_session, follow):
    """With one question at a time, of 5 s each, this took minutes."""
    session, store = open_session(), Store()
    unit = LoggedUnit(session, "good")
    unit.sweep(3)
    follow(store)
    store.wait_for(lambda stored: stored.of("good") == [1, 2, 3])
    silent = [SilentUnit(session, f"silent{number}") for number in range(30)]
    assert any(each.asked.acquire(timeout=PATIENCE_S) for each in silent)
    began_s = monotonic()
    unit._lose = 1.0  # the rest must come from the log
    unit.sweep(700)
    unit.status()
    store.wait_for(lambda stored: stored.of("good") == list(range(1, 704)))
    assert monotonic() - began_s < QUERY_TIMEOUT_S  # it waited for none of the others


def test_live_sweeps_of_a_unit_come_though_its_log_does_not_answer(open_session, far, follow):
    store = Store()
    store.cursors["u1"] = Cursor(unit="u1", log_id="a", log_sequence=4)
    silent = SilentUnit(open_session(), "u1")
    follow(store)
    assert silent.asked.acquire(timeout=PATIENCE_S)
    began_s = monotonic()
    far.publish(keys.sweep("room", "u1"), Sweep(site="room", unit="u1", log_id="a", log_sequence=5))
    store.wait_for(lambda stored: stored.of("u1") == [5])
    assert monotonic() - began_s < QUERY_TIMEOUT_S


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
    most_bytes = 1000
    monkeypatch.setattr(log_follower, "MOST_LIVE_BYTES", most_bytes)
    monkeypatch.setattr(log_follower, "MOST_ANSWERS", 2)
    hangs, go_on = threading.Event(), threading.Event()
    go_on.set()

    class Hanging(Store):
        def deliver(self, sweeps):
            if not go_on.is_set():
                hangs.set()
                assert go_on.wait(PATIENCE_S)
            held.append((follower._live_bytes, len(follower._answers)))
            super().deliver(sweeps)

    held, session, store = [], open_session(), Hanging()
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
    assert most_bytes / 2 < follower._live_bytes <= most_bytes
    go_on.set()
    store.wait_for(lambda stored: len(stored.sweeps) == 12 * 21 + 1)
    assert all(store.of(f"u{number}") == list(range(1, 22 + (number == 0))) for number in range(12))
    assert max(live_bytes for live_bytes, _ in held) <= most_bytes
    assert max(answers for _, answers in held) <= 2
    assert follower.counters()["lost"] == 0


@pytest.mark.parametrize("seed", range(4))
def test_each_sweep_is_stored_once_in_order_under_random_faults(router, open_session, follow, seed):
    dice = random.Random(seed)
    store = Store(fail=lambda: dice.random() < 0.1)
    session = open_session()
    units = {name: LoggedUnit(session, name, lose=0.2, dice=dice) for name in ("u1", "u2", "u3")}
    follower = follow(store)
    for _ in range(60):
        for unit in units.values():
            unit.sweep(dice.randrange(8))
        match dice.randrange(20):
            case 0:
                router.restart()
            case 1:
                follower.close()
                follower = follow(store)
            case 2:
                dice.choice(list(units.values())).status()
    store.wait_for(lambda stored: all(len(stored.of(name)) >= unit.head for name, unit in units.items()))
    for name, unit in units.items():
        assert store.of(name) == list(range(1, unit.head + 1))
    assert follower.counters()["lost"] == 0


def test_sweeps_made_while_the_router_was_dead_come_when_it_is_back(router, open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    unit.sweep(3)
    follow(store, poll_s=3600.0)
    store.wait_for(lambda stored: len(stored.sweeps) == 3)
    router.stop()
    unit.sweep(4)
    router.start()
    store.wait_for(lambda stored: stored.of("u1") == list(range(1, 8)))


def test_sweeps_that_are_made_while_a_long_log_is_read_come_after_it_in_order(open_session, follow):
    unit, logged = LoggedUnit(open_session(), "u1"), 2000  # four replies

    class Busy(Store):
        """A sweep is made and published with each delivery of the log."""

        def deliver(self, sweeps):
            super().deliver(sweeps)
            if len(self.sweeps) <= logged:
                unit.sweep()

    store = Busy()
    unit.sweep(logged)
    follower = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) >= logged + 4)
    assert store.of("u1") == list(range(1, unit.head + 1))
    assert store.cursors["u1"].log_sequence == unit.head > logged
    assert follower.counters()["lost"] == 0
