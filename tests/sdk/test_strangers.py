"""On a bus without certificates a stranger publishes sweeps under a unit's next numbers: none of them is delivered."""

import asyncio
import random

import pytest
import zenoh
from sdk.followed import POLL_S, LoggedUnit, Store
from system.processes import PATIENCE_S, wait_until

from noctule import AsyncClient, AsyncLogFollower, keys
from noctule.messages_pb2 import Sweep

SWEEPS = 150


def forge(session, number, dice):
    """A sweep that is none of the unit's, under the number that the unit's next one has, or near it."""
    forged = Sweep(site="room", unit="u1", log_id=dice.choice("aaab"), waypoint=77)
    forged.log_sequence = max(number + dice.choice((0, 0, 0, 0, 1, 7, -3, 2**50)), 1)
    session.put(keys.sweep("room", "u1"), forged.SerializeToString(), congestion_control=zenoh.CongestionControl.BLOCK)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_stranger_who_races_the_gateway_alters_no_sweep_and_costs_none(open_session, follow, endpoint, seed):
    """Of two live sweeps with one number the first was delivered, and the unit's own was not."""
    dice, unit, forger, store = random.Random(seed), LoggedUnit(open_session(), "u1"), open_session(), Store()
    follower = follow(store)

    async def read_beside(read):
        async with AsyncClient("room", [endpoint]) as client, AsyncLogFollower(client, {}, POLL_S) as batches:
            async for sweeps in batches:
                read.extend(sweeps)
                if len(read) >= SWEEPS:
                    return

    def race():
        for number in range(1, SWEEPS + 1):
            order = [lambda: unit.sweep(), *(dice.randrange(3) * [lambda number=number: forge(forger, number, dice)])]
            for publish in dice.sample(order, len(order)):
                publish()
            if number % 15 == 0:
                store.wait_for(lambda stored, number=number: len(stored.sweeps) >= number)
        forge(forger, SWEEPS + 1, random.Random(0))

    async def both(read):
        await asyncio.wait_for(asyncio.gather(read_beside(read), asyncio.to_thread(race)), PATIENCE_S)

    read = []
    asyncio.run(both(read))
    wait_until(lambda: follower.counters()["refused"] > 0, "no stranger is counted")
    assert store.sweeps == read == unit.sweeps
    assert follower.counters()["lost"] == 0
