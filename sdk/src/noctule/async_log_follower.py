"""Durable reading of a site for asyncio: every sweep once, by ``async for`` over batches."""

import asyncio
import threading
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import Self

from noctule.async_client import AsyncClient
from noctule.errors import BusError
from noctule.log_follower import LogFollower
from noctule.mailbox import Mailbox
from noctule.messages_pb2 import Cursor, Sweep


class AsyncLogFollower:
    """A LogFollower whose batches are iterated over, in an ``async with`` statement:

    async with AsyncLogFollower(client, cursors) as batches:
        async for sweeps in batches:  # some sweeps of one unit, in order
            await store(sweeps)  # and the cursor with them, in one transaction

    A batch counts as taken when the loop asks for the next one. If the loop ends before that, the same sweeps come
    again to the next follower that begins with the same cursors.
    """

    def __init__(self, client: AsyncClient, cursors: Mapping[str, Cursor], poll_s: float = 10.0) -> None:
        """``cursors`` and ``poll_s`` are those of LogFollower."""
        self._client = client
        self._follower = LogFollower(client.client, self._deliver, cursors, poll_s)
        self._batches: Mailbox[Sequence[Sweep]] | None = None
        self._taken = threading.Event()
        self._in_hand = False
        self._closed = False

    async def __aenter__(self) -> Self:
        # Its room for one is enough: the follower's thread waits until a batch is taken.
        self._batches = Mailbox(asyncio.get_running_loop(), 1)
        await self._client.in_thread(self._follower.start)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._closed = True
        self._taken.set()
        if self._batches is not None:
            self._batches.end()
        await self._client.in_thread(self._follower.close)

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Sequence[Sweep]:
        """The next batch. Raises BusError outside of ``async with``."""
        if self._batches is None:
            raise BusError("the follower has not begun: use it in an async with statement")
        if self._in_hand:
            self._in_hand = False
            self._taken.set()
        sweeps = await anext(self._batches)
        self._in_hand = True
        return sweeps

    def cursors(self) -> dict[str, Cursor]:
        """By unit, the last sweep that was taken."""
        return self._follower.cursors()

    def counters(self) -> dict[str, int]:
        """As LogFollower.counters()."""
        return self._follower.counters()

    def _deliver(self, sweeps: Sequence[Sweep]) -> None:
        """Hand on a batch and wait until it is taken; on the follower's thread."""
        self._taken.clear()
        if not self._closed and self._batches is not None:
            self._batches.put(sweeps)
            self._taken.wait()
        if self._closed:
            raise BusError("the reader ended before it took these sweeps; they stay in the log")
