"""The client for asyncio: a Client beneath does all the work, on its own threads, and never blocks the event loop."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import ParamSpec, Self, TypeVar

import zenoh

from noctule import bus, keys
from noctule.client import Client
from noctule.errors import BusError
from noctule.mailbox import Mailbox
from noctule.messages_pb2 import (
    CommandReply,
    CommandRequest,
    Contour,
    Features,
    GridTile,
    LogRecords,
    Pose,
    ServiceStatus,
    Sweep,
    UnitStatus,
)
from noctule.subscription import Subscription

_THREADS = 8  # questions that may be open at a time

P = ParamSpec("P")
T = TypeVar("T")


class AsyncClient:
    """One site on the bus, for asyncio. Use it in an ``async with`` statement, which waits for a router.

    The methods are those of Client: what asks is awaited, and each on_... has a watch_... to iterate over. A watch
    subscribes when its iteration begins, and ends with the client. It holds ``queue_length`` messages; when its task is
    slower than the bus the oldest are dropped, and counters() counts them.
    """

    def __init__(
        self,
        site: str,
        connect: Sequence[str] = (),
        session: zenoh.Session | None = None,
        queue_length: int = 10_000,
        tls_folder: Path | None = None,
    ) -> None:
        """As in Client."""
        self.site = keys.name(site, "site")
        self._connect, self._given, self._tls_folder = connect, session, tls_folder
        self._queue_length = queue_length
        self._executor = ThreadPoolExecutor(_THREADS, f"noctule-ask-{site}")
        self._session: zenoh.Session | None = None
        self._client: Client | None = None
        self._mailboxes: set[Mailbox] = set()
        self._closed = False
        self._dropped = 0  # by watches that have ended

    async def __aenter__(self) -> Self:
        given_up = threading.Event()

        def while_waiting() -> None:
            if given_up.is_set():
                raise BusError("joining was cancelled")

        opened = self._executor.submit(self._open, while_waiting)
        try:
            self._client = await asyncio.wrap_future(opened)
        except BaseException:
            given_up.set()
            opened.add_done_callback(self._close_what_came_too_late)
            self._executor.shutdown(wait=False)
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """End all watches and the session, unless that is the caller's."""
        self._closed = True
        for mailbox in list(self._mailboxes):
            mailbox.end()
        try:
            await self.in_thread(self._close)
        finally:
            self._executor.shutdown(wait=False)

    @property
    def client(self) -> Client:
        """The client beneath, whose calls block. Raises BusError before ``async with`` has joined."""
        if self._client is None:
            raise BusError("the client has not joined: use it in an async with statement")
        return self._client

    def counters(self) -> dict[str, int]:
        """As Client.counters(); ``dropped`` counts what the watches have dropped too."""
        counts = self.client.counters()
        dropped = self._dropped + sum(mailbox.dropped for mailbox in self._mailboxes)
        return counts | {"dropped": counts["dropped"] + dropped}

    # ---- Messages as they come ------------------------------------------------------------------------------------

    def watch_sweeps(self, unit: str = keys.ANY) -> AsyncIterator[Sweep]:
        """Sweeps as they are published; some may be missed. AsyncLogFollower misses none."""
        return self._watch(lambda put: self.client.on_sweep(put, unit))

    def watch_poses(self, unit: str = keys.ANY) -> AsyncIterator[tuple[str, Pose]]:
        """Poses of units that are tracked, each with the name of its unit."""
        return self._watch(lambda put: self.client.on_pose(lambda name, pose: put((name, pose)), unit))

    def watch_contours(self) -> AsyncIterator[Contour]:
        """The site's contour, and each new one."""
        return self._watch(lambda put: self.client.on_contour(put))

    def watch_features(self) -> AsyncIterator[Features]:
        """The feature points of the mapper's last update, and of each new one."""
        return self._watch(lambda put: self.client.on_features(put))

    def watch_grid(self) -> AsyncIterator[GridTile]:
        """The tiles of the reliability grid, and each again when it has changed."""
        return self._watch(lambda put: self.client.on_grid(put))

    def watch_unit_statuses(self) -> AsyncIterator[UnitStatus]:
        """The status of each unit, and each new one."""
        return self._watch(lambda put: self.client.on_unit_status(put))

    def watch_service_statuses(self) -> AsyncIterator[ServiceStatus]:
        """The status of each service, and each new one."""
        return self._watch(lambda put: self.client.on_service_status(put))

    def watch_alive(self) -> AsyncIterator[tuple[str, bool]]:
        """Each unit's name with True when a gateway serves it, False when none does."""
        return self._watch(lambda put: self.client.on_alive(lambda name, alive: put((name, alive))))

    # ---- Questions and commands -----------------------------------------------------------------------------------

    async def contour(self) -> Contour | None:
        """As Client.contour()."""
        return await self.in_thread(self.client.contour)

    async def unit_statuses(self) -> list[UnitStatus]:
        """As Client.unit_statuses()."""
        return await self.in_thread(self.client.unit_statuses)

    async def service_statuses(self) -> list[ServiceStatus]:
        """As Client.service_statuses()."""
        return await self.in_thread(self.client.service_statuses)

    async def units(self) -> set[str]:
        """As Client.units()."""
        return await self.in_thread(self.client.units)

    async def log(self, unit: str, from_sequence: int, max: int = 500) -> LogRecords | None:
        """As Client.log()."""
        return await self.in_thread(self.client.log, unit, from_sequence, max)

    async def history(self, unit: str, from_sequence: int = 1) -> AsyncIterator[Sweep]:
        """As Client.history(), for ``async for``."""
        sweeps = self.client.history(unit, from_sequence)
        while (sweep := await self.in_thread(next, sweeps, None)) is not None:
            yield sweep

    async def command(self, unit: str, name: str, request: CommandRequest, timeout_s: float) -> CommandReply:
        """As Client.command(). One that is cancelled may be carried out all the same."""
        return await self.in_thread(self.client.command, unit, name, request, timeout_s)

    async def publish_pose(self, unit: str, pose: Pose) -> None:
        """As Client.publish_pose()."""
        await self.in_thread(self.client.publish_pose, unit, pose)

    async def in_thread(self, call: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """Await what ``call`` returns, made on a thread of this client, so that the event loop goes on.

        Raises BusError when the client is closed.
        """
        try:
            made = self._executor.submit(partial(call, *arguments, **named))
        except RuntimeError as error:
            raise BusError("the client is closed") from error
        return await asyncio.wrap_future(made)

    # ---- How ------------------------------------------------------------------------------------------------------

    async def _watch(self, subscribe: Callable[[Callable[[T], None]], Subscription]) -> AsyncIterator[T]:
        mailbox: Mailbox[T] = Mailbox(asyncio.get_running_loop(), self._queue_length)
        self._mailboxes.add(mailbox)
        subscription = None
        try:
            subscription = await self.in_thread(subscribe, mailbox.put)
            async for item in mailbox:
                yield item
        except zenoh.ZError:
            if not self._closed:  # else it was closed before the iteration had begun
                raise
        finally:
            if subscription is not None:
                subscription.undeclare()
            self._mailboxes.discard(mailbox)
            self._dropped += mailbox.dropped

    def _open(self, while_waiting: Callable[[], None]) -> Client:
        if self._given is None:
            self._session = bus.open_session(self._connect, tls_folder=self._tls_folder, while_waiting=while_waiting)
        session = self._given or self._session
        return Client(self.site, session=session, queue_length=self._queue_length, tls_folder=self._tls_folder)

    def _close(self) -> None:
        if self._client is not None:
            self._client.close()
        if self._session is not None:
            self._session.close()

    def _close_what_came_too_late(self, opened: "Future[Client]") -> None:
        if opened.cancelled() or opened.exception() is not None:
            return
        self._client = opened.result()
        self._close()
