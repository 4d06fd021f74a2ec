"""Items from any thread for one asyncio task."""

import asyncio
import threading
from collections import deque
from contextlib import suppress
from typing import Generic, Self, TypeVar

from google.protobuf.message import Message

from noctule.delivery import HELD_BYTES

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds up to ``capacity`` items, of ``most_bytes`` together, until its task takes them; when it is full the oldest
    gives way, and is counted.

    Iterate over it by ``async for``, which ends after end().
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, capacity: int, most_bytes: int = HELD_BYTES) -> None:
        self.dropped = 0
        self._loop, self._capacity, self._most_bytes = loop, capacity, most_bytes
        self._items: deque[T] = deque()
        self._bytes = 0
        self._lock = threading.Lock()
        self._arrived = asyncio.Event()
        self._waking = False  # so that a loop that hangs piles up no more than one call
        self._ended = False

    def put(self, item: T) -> None:
        """Add an item, from any thread; never waits."""
        with self._lock:
            self._items.append(item)
            self._bytes += _size_bytes(item)
            while len(self._items) > self._capacity or (self._bytes > self._most_bytes and len(self._items) > 1):
                self._take()
                self.dropped += 1
        self._wake()

    def end(self) -> None:
        """Let the iteration end after the items that are held, from any thread."""
        self._ended = True
        self._wake()

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        while True:
            self._arrived.clear()
            with self._lock:
                if self._items:
                    return self._take()
            if self._ended:
                raise StopAsyncIteration
            await self._arrived.wait()

    def _take(self) -> T:
        item = self._items.popleft()
        self._bytes -= _size_bytes(item)
        return item

    def _wake(self) -> None:
        with self._lock:
            if self._waking:
                return
            self._waking = True
        with suppress(RuntimeError):  # the loop was closed, and with it the task
            self._loop.call_soon_threadsafe(self._on_wake)

    def _on_wake(self) -> None:
        with self._lock:
            self._waking = False
        self._arrived.set()


def _size_bytes(item: object) -> int:
    return item.ByteSize() if isinstance(item, Message) else 0
