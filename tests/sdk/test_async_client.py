"""The client for asyncio: what the threaded one does, awaited and iterated over, without a blocked event loop."""

import asyncio
import threading

import pytest
from system.processes import PATIENCE_S

from noctule import AsyncClient, AsyncLogFollower, bus, keys
from noctule.errors import BusError
from noctule.mailbox import Mailbox
from noctule.messages_pb2 import CommandReply, CommandRequest, Contour, LogRecords, Sweep, UnitStatus


def run(main):
    async def in_time():
        async with asyncio.timeout(PATIENCE_S):
            return await main

    return asyncio.run(in_time())


def test_watches_bring_messages_as_they_come_and_the_loop_goes_on_meanwhile(router, far):
    async def main():
        async with AsyncClient("room", connect=[router.endpoint]) as client:
            sweeps = client.watch_sweeps("u1")
            first = asyncio.ensure_future(anext(sweeps))
            sent = [Sweep(site="room", unit="u1", log_sequence=n) for n in range(5)]
            await asyncio.to_thread(far.publish, keys.sweep("room", "u1"), *sent)
            assert [await first] + [await anext(sweeps) for _ in range(4)] == sent
            assert client.counters()["dropped"] == 0

    run(main())


def test_a_watched_state_begins_with_the_present(router, far, known):
    async def main():
        async with AsyncClient("room", connect=[router.endpoint]) as client:
            state = bus.StatePublisher(far.session, keys.contour("room"), Contour)
            state.put(Contour(version=1))
            await client.in_thread(known, client.client.session, keys.contour("room"))
            async for contour in client.watch_contours():
                if contour.version == 2:
                    return
                state.put(Contour(version=2))

    run(main())


def test_questions_and_commands_are_awaited(router, far):
    async def main():
        async with AsyncClient("room", connect=[router.endpoint]) as client:
            log, rpc = keys.log("room", "u1"), keys.rpc("room", "u1", "start")
            sweeps = [Sweep(unit="u1", log_id="a", log_sequence=n) for n in (1, 2)]
            records = LogRecords(log_id="a", head=2, tail=1, sweeps=sweeps).SerializeToString()
            for key, reply in ((log, records), (rpc, CommandReply(done=True).SerializeToString())):
                await client.in_thread(
                    far.answer, key, lambda query, key=key, reply=reply: query.reply(key, reply), client.client.session
                )
            assert [sweep async for sweep in client.history("u1")] == sweeps
            assert (await client.command("u1", "start", CommandRequest(), PATIENCE_S)).done
            assert (await client.contour(), await client.units()) == (None, set())
            with pytest.raises(BusError, match="no gateway serves unit 'u9'"):
                await client.command("u9", "start", CommandRequest(), PATIENCE_S)

    run(main())


def test_watches_end_with_their_client_whether_they_have_begun_or_not(router, far):
    async def main():
        async with AsyncClient("room", connect=[router.endpoint]) as client:
            begun, not_begun = client.watch_sweeps("u1"), client.watch_sweeps("u1")
            first = asyncio.ensure_future(anext(begun))
            await client.in_thread(far.publish, keys.sweep("room", "u1"), Sweep(unit="u1"))
            await first
            waiting = asyncio.ensure_future(anext(begun, "ended"))
            beginning = asyncio.ensure_future(anext(not_begun, "ended"))
            await asyncio.sleep(0)  # both tasks run up to their first wait
        assert [await waiting, await beginning] == ["ended", "ended"]
        with pytest.raises(BusError, match="the client is closed"):
            await client.units()

    run(main())


def test_joining_can_be_cancelled_where_no_router_is(endpoint):
    async def main():
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1), AsyncClient("room", connect=[endpoint]):
                pass

    run(main())
    for thread in threading.enumerate():
        if thread.name.startswith("noctule-ask"):
            thread.join(PATIENCE_S)
            assert not thread.is_alive()


def test_a_mailbox_that_is_full_drops_the_oldest_and_ends_after_what_it_holds():
    async def main():
        mailbox = Mailbox(asyncio.get_running_loop(), 3)
        for number in range(5):
            mailbox.put(number)
        mailbox.end()
        return [item async for item in mailbox], mailbox.dropped

    assert run(main()) == ([2, 3, 4], 2)


def test_batches_of_which_none_was_asked_for_after_come_again(router, far):
    """A batch is taken when the next is asked for: one whose store failed is not."""
    key = keys.log("room", "u1")

    def answer(query):
        first = int(query.parameters.get("from"))
        sweeps = [Sweep(unit="u1", log_id="a", log_sequence=n) for n in range(first, min(first + 2, 7))]
        query.reply(key, LogRecords(log_id="a", head=6, tail=1, sweeps=sweeps).SerializeToString())

    async def main():
        stored, cursors = [], {}
        async with AsyncClient("room", connect=[router.endpoint]) as client:
            await client.in_thread(far.answer, key, answer, client.client.session)
            bus.StatePublisher(far.session, keys.unit_status("room", "u1"), UnitStatus).put(
                UnitStatus(unit="u1", log_id="a", log_head=6)
            )
            token = far.session.liveliness().declare_token(keys.alive("room", "u1"))
            for fail_at in (2, 4, None):
                async with AsyncLogFollower(client, cursors, poll_s=0.3) as batches:
                    async for sweeps in batches:
                        if sweeps[-1].log_sequence == fail_at:
                            break  # the store failed
                        stored += [sweep.log_sequence for sweep in sweeps]
                        if stored[-1] == 6:
                            break
                    cursors = batches.cursors()
            token.undeclare()
        return stored

    assert run(main()) == [1, 2, 3, 4, 5, 6]
