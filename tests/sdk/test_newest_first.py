"""A reader that is far behind a log reads its newest sweeps first, and loses nothing of the history behind them."""

import itertools

import pytest
from sdk.test_log_follower import POLL_S, LoggedUnit, Store

from noctule import Client, LogFollower

LOGGED = 2000


class MapStore(Store):
    """A store that takes sweeps ahead of the cursor too, each sweep once."""

    def __init__(self, fail=lambda: False):
        super().__init__(fail)
        self.ahead = []

    def deliver_ahead(self, sweeps):
        with self._changed:
            self.ahead.append((len(self.sweeps), [sweep.log_sequence for sweep in sweeps]))
            self._changed.notify_all()

    def held(self):
        return {*self.of("u1"), *itertools.chain.from_iterable(sequences for _, sequences in self.ahead)}


@pytest.fixture
def follow(open_session):
    """Starts a follower with a client of its own; returns what ends it."""
    running = []

    def start(store):
        client = Client("room", session=open_session())
        follower = LogFollower(client, store.deliver, dict(store.cursors), POLL_S, store.deliver_ahead)
        follower.start()
        running.append((follower, client))
        return follower

    yield start
    for follower, client in running:
        follower.close()
        client.close()


def test_the_newest_sweeps_of_a_long_log_come_before_its_history(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1", keep=LOGGED), MapStore()
    unit.sweep(LOGGED + 7)
    follower = follow(store)
    store.wait_for(lambda stored: stored.cursors and stored.cursors["u1"].log_sequence >= LOGGED - 32)
    assert store.ahead[0] == (0, list(range(LOGGED + 7 - 31, LOGGED + 8)))
    unit.sweep(3)
    store.wait_for(lambda stored: stored.held() == set(range(8, LOGGED + 11)))
    assert store.of("u1") == sorted(set(store.of("u1")))
    assert follower.counters()["lost"] == 0
    unit.sweep()
    store.wait_for(lambda stored: stored.cursors["u1"].log_sequence == LOGGED + 11)


def test_sweeps_that_are_made_while_the_history_is_read_do_not_wait_for_it(open_session, follow):
    unit = LoggedUnit(open_session(), "u1")

    class Busy(MapStore):
        """A sweep is made and published with each page of history that is delivered."""

        def deliver(self, sweeps):
            super().deliver(sweeps)
            unit.sweep()

    store = Busy()
    unit.sweep(LOGGED)
    follow(store)
    store.wait_for(lambda stored: set(range(1, LOGGED + 5)) <= stored.held())
    before, made = next((before, made) for before, made in store.ahead if made[0] == LOGGED + 1)
    assert before < LOGGED
    assert made == [LOGGED + 1]


def test_a_reader_that_ends_amid_the_history_goes_on_with_it(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), MapStore()
    unit.sweep(LOGGED)
    store.fail = lambda: bool(store.sweeps)  # after the first page
    follower = follow(store)
    store.wait_for(lambda stored: stored.ahead and stored.sweeps)
    follower.close()
    left, store.ahead, store.fail = store.cursors["u1"].log_sequence, [], lambda: False
    assert left == 500
    follow(store)
    store.wait_for(lambda stored: stored.held() == set(range(1, LOGGED + 1)))
    assert store.of("u1")[500] == 501


def test_another_log_amid_the_history_is_read_from_its_tail(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), MapStore()
    unit.sweep(LOGGED)
    store.fail = lambda: True
    follow(store)
    store.wait_for(lambda stored: stored.ahead)
    unit.begin_log("b")
    unit.sweep(4)
    store.fail = lambda: False
    store.wait_for(
        lambda stored: [sweep.log_sequence for sweep in stored.sweeps if sweep.log_id == "b"] == [1, 2, 3, 4]
    )


def test_a_reader_that_is_little_behind_reads_in_order(open_session, follow):
    unit, store = LoggedUnit(open_session(), "u1"), MapStore()
    unit.sweep(500)
    follow(store)
    store.wait_for(lambda stored: stored.of("u1") == list(range(1, 501)))
    assert store.ahead == []
