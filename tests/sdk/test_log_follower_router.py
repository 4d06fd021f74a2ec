"""A follower whose router dies as a process does has every sweep once all the same."""

import random

import pytest
from sdk.followed import LoggedUnit, RouterProcess, Store


@pytest.fixture
def router(endpoint):
    router = RouterProcess(endpoint)
    yield router
    router.stop()


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
