"""A follower has every sweep once and in order: what was logged before it began, and whose sign on the bus was lost."""

import queue

from sdk.conftest import until_matching
from sdk.followed import PATIENCE_S, POLL_S, LoggedUnit, Store
from system.processes import wait_until

from noctule import bus, keys
from noctule.messages_pb2 import Cursor, LogRecords, Sweep, UnitStatus


def test_what_was_logged_before_and_after_the_start_comes_in_order(open_session, follow):
    unit = LoggedUnit(open_session(), "u1")
    unit.sweep(1200)
    store = Store()
    follower = follow(store)
    store.wait_for(lambda stored: len(stored.sweeps) == 1200)
    unit.sweep(30)
    store.wait_for(lambda stored: len(stored.sweeps) == 1230)
    assert store.sweeps == unit.sweeps
    last = Cursor(unit="u1", log_id="a", log_sequence=1230)
    wait_until(lambda: follower.cursors() == {"u1": last}, "the cursor does not follow what was stored")


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
    wait_until(lambda: second.counters()["delivered"] == 10, "not ten are counted")


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

    wait_until(is_found, "nobody notices", every_s=POLL_S / 20)


def test_a_status_that_was_made_before_a_sweep_takes_nothing_from_the_sweeps_sign(open_session, follow):
    """Both come while the log is asked. The sweep waited for the unit's next status, or for the next poll."""
    session, queries, sweeps = open_session(), queue.Queue(), []
    key = keys.log("room", "u1")

    def answer(query, head):
        with query:
            begin = int(query.parameters.get("from"))
            records = LogRecords(log_id="a", head=head, tail=1, sweeps=sweeps[begin - 1 : head])
            query.reply(key, records.SerializeToString())

    def sweep():
        sweeps.append(Sweep(site="room", unit="u1", log_id="a", log_sequence=len(sweeps) + 1))
        live.put(sweeps[-1].SerializeToString())

    queryable = session.declare_queryable(key, queries.put)
    store = Store()
    follower = follow(store, poll_s=3600.0)
    live = bus.declare_publisher(session, keys.sweep("room", "u1"), Sweep)
    until_matching(live)
    sweep()
    first = queries.get(timeout=PATIENCE_S)
    sweep()
    wait_until(lambda: follower._client.counters()["delivered"] >= 2, "the sweep does not come")
    status = bus.StatePublisher(session, keys.unit_status("room", "u1"), UnitStatus)
    status.put(UnitStatus(unit="u1", log_id="a", log_head=1, log_tail=1))
    wait_until(lambda: follower._units["u1"].told, "the status does not come")
    answer(first, head=1)  # it was read before the second was committed
    store.wait_for(lambda stored: stored.of("u1") == [1])
    answer(queries.get(timeout=PATIENCE_S), head=2)
    store.wait_for(lambda stored: stored.of("u1") == [1, 2])
    queryable.undeclare()
    status.close()


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
    wait_until(lambda: second.counters()["lost"] == 30, "not thirty are counted")


def test_a_new_log_is_read_from_its_beginning(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), Store()
    follow(store)
    unit.sweep(5)
    store.wait_for(lambda stored: len(stored.sweeps) == 5)
    unit.begin_log("b")
    unit.sweep(3)
    store.wait_for(lambda stored: len(stored.sweeps) == 8)
    assert [(sweep.log_id, sweep.log_sequence) for sweep in store.sweeps[5:]] == [("b", 1), ("b", 2), ("b", 3)]


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
