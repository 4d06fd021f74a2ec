"""A measurement of one unit under way: through its link, until it is over, given up, or takes too long.

Reads no clock but for the time that a figure is given: what it waits for is told the time.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from noctule.messages_pb2 import CommandReply, Measurement, UnitStatus
from noctule_gateway.errors import CommandError, GatewayError
from noctule_gateway.link.events import OrderSettled
from noctule_gateway.link.link import Link
from noctule_gateway.measure import procedure
from noctule_gateway.measure.procedure import Procedure
from noctule_gateway.wire.frames import Mechanics, Settings, Status, Stop


@dataclass(frozen=True)
class _UnderWay:
    """A measurement, who has asked for it, and until when it must be over."""

    procedure: Procedure
    request_id: str
    reply: Future[CommandReply]
    due_s: float


class Measuring:
    """At most one measurement at a time of the unit behind ``link``; ``status`` gives the unit's status for a reply."""

    def __init__(self, link: Link, status: Callable[[], UnitStatus]) -> None:
        self._link, self._status = link, status
        self._now: _UnderWay | None = None
        self._found: dict[str, list[Measurement]] = {}  # the latest by command

    @property
    def under_way(self) -> bool:
        """The unit measures itself: it takes no other order but a stop."""
        return self._now is not None

    @property
    def latest(self) -> list[Measurement]:
        """The latest figures of each command."""
        return [each for found in self._found.values() for each in found]

    def begin(self, name: str, settings: Settings, request_id: str, reply: Future[CommandReply], now_s: float) -> None:
        """Begin the command ``name`` with a unit that goes by ``settings``. Raises CommandError if it can't now."""
        begun = Procedure(name, settings, self._status(), self._link.order)
        self._now = _UnderWay(begun, request_id, reply, now_s + begun.limit_s)

    def settled(self, event: OrderSettled) -> None:
        """Something became of an order, which may be another's."""
        if self._now is None or event.ticket != self._now.procedure.ticket:
            return
        if event.error is None:
            self._now.procedure.settled()
        else:
            self.give_up(event.error)

    def status_read(self, status: Status) -> None:
        """The unit has told what it is doing."""
        self._go_on(lambda now: now.status_read(status))

    def mechanics_read(self, mechanics: Mechanics) -> None:
        """The unit has told what it has measured."""
        self._go_on(lambda now: now.mechanics_read(mechanics))

    def advance(self, now_s: float) -> None:
        """Time has passed: a unit that takes too long is stopped. To be called once a second or so."""
        now = self._now
        if now is None or now_s < now.due_s:
            return
        self.give_up(CommandError(f"the unit did not end it within {now.procedure.limit_s:.0f} s, and is stopped"))
        if self._link.identified:
            self._link.order(Stop(0))

    def give_up(self, error: GatewayError) -> None:
        """End it, if one is under way, for this reason. An order that still waits does not go out any more."""
        now, self._now = self._now, None
        if now is None:
            return
        if now.procedure.ticket is not None:
            self._link.withdraw(now.procedure.ticket)
        now.reply.set_result(CommandReply(request_id=now.request_id, error=str(error), status=self._status()))

    def _go_on(self, read: Callable[[Procedure], None]) -> None:
        if self._now is None:
            return
        try:
            read(self._now.procedure)
        except GatewayError as error:
            self.give_up(error)
            return
        if self._now.procedure.over:
            self._end(self._now)

    def _end(self, now: _UnderWay) -> None:
        self._now = None
        found = self._found[now.procedure.name] = now.procedure.measurements(self._status())
        for each in found:
            each.time.FromNanoseconds(time.time_ns())
        why = now.procedure.failure()
        now.reply.set_result(
            CommandReply(
                request_id=now.request_id,
                done=why is None,
                error=why or "",
                detail="" if why else procedure.summary(found),
                status=self._status(),
                measurements=found,
            )
        )
