"""What strangers send without end makes nothing of a client grow without end."""

import asyncio
import threading
from functools import partial
from itertools import accumulate
from types import SimpleNamespace
from typing import Any

from system.processes import PATIENCE_S, wait_until

from noctule import Client, keys, states
from noctule.delivery import Delivery
from noctule.mailbox import Mailbox
from noctule.messages_pb2 import Features, Sweep
from noctule.states import StateReader


def test_messages_that_wait_for_a_slow_callback_are_bounded_by_their_bytes(open_session, far, collected, monkeypatch):
    monkeypatch.setattr("noctule.client.Delivery", partial(Delivery, most_bytes=2000))
    sweeps = [Sweep(unit="u1", log_sequence=n, log_id="x" * 60) for n in range(200)]
    have_room = sum(size_bytes <= 2000 for size_bytes in accumulate(each.ByteSize() for each in sweeps[1:]))
    assert 20 <= have_room <= 2000 / 60
    with Client("room", session=open_session()) as client:
        arrived, go_on = threading.Event(), threading.Event()

        def slow(sweep: Sweep) -> None:
            arrived.set()
            go_on.wait(PATIENCE_S)
            collected.add(sweep.log_sequence)

        client.on_sweep(slow)
        far.publish(keys.sweep("room", "u1"), sweeps[0])
        assert arrived.wait(PATIENCE_S)
        far.publish(keys.sweep("room", "u1"), *sweeps[1:])
        wait_until(lambda: client.counters()["dropped"] == len(sweeps) - 1 - have_room, "not all others are dropped")
        go_on.set()
        collected.wait_for(lambda came: len(came) == 1 + have_room)
    assert collected == list(range(1 + have_room))


def test_one_message_is_delivered_however_large_it_is() -> None:
    """It is the callback that refuses it, with the reason."""
    made = threading.Event()
    delivery = Delivery("large", capacity=10, most_bytes=2000)
    delivery.put(lambda: made.set() or True, size_bytes=10**9)
    assert made.wait(60.0)
    delivery.close()


def test_messages_that_wait_for_a_slow_task_are_bounded_by_their_bytes_and_the_newest_stay() -> None:
    async def main() -> tuple[list[int], int]:
        mailbox: Mailbox[Any] = Mailbox(asyncio.get_running_loop(), capacity=1000, most_bytes=2000)
        features = [Features(version=n, mapper="x" * 60) for n in range(1, 201)]
        for each in features:
            mailbox.put(each)
        mailbox.end()
        return [each.version async for each in mailbox], mailbox.dropped

    held, dropped = asyncio.run(main())
    assert 20 <= len(held) <= 2000 / 60
    assert held == list(range(201 - len(held), 201)) and dropped == 200 - len(held)


def test_of_keys_that_somebody_makes_up_a_reader_of_states_knows_the_newest_only(monkeypatch) -> None:
    monkeypatch.setattr(states, "MOST_KEYS", 10)
    passed: list[bytes] = []
    reader: StateReader[Any] = StateReader(lambda state: state.payload.to_bytes(), passed.append)

    def state(key: int) -> Any:
        return SimpleNamespace(key_expr=f"key/{key}", payload=SimpleNamespace(to_bytes=lambda: b"%d" % key))

    for key in range(11):
        assert reader.on_published(state(key))
    reader.asking()
    assert not reader.on_present(state(10))
    assert reader.on_present(state(0))
    assert passed == [b"%d" % key for key in (*range(11), 0)]
