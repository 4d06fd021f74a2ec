"""The commands of the bus to one unit: carried out through its link, or answered from what is known of it.

All methods are called on the line's thread, but for the futures' own.
"""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass

from noctule.bounds import Number
from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus
from noctule_gateway.errors import CommandError, GatewayError, UnderWayError
from noctule_gateway.link.events import OrderSettled
from noctule_gateway.link.link import Link
from noctule_gateway.measure import procedure
from noctule_gateway.measure.measuring import Measuring
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Ending, describe
from noctule_gateway.wire import limits, orders, settings_message
from noctule_gateway.wire.frames import Mechanics, Settings, Status

AT_ONCE = ("hello", "status")
SETTINGS = "settings"
UPDATE = "update"
ACCEPT_ROOM = "accept_room"
STOP = "stop"
_MEASURING = "the unit measures itself: wait until that is over, or stop it"


@dataclass(frozen=True)
class _Command:
    name: str
    request: CommandRequest
    reply: Future[CommandReply]


class CommandRunner:
    """Commands under way; ``status`` gives the unit's status for a reply, ``update`` begins an update or raises.

    ``accept_room`` has what the unit used to hear forgotten, and then calls what it is given, with an error if the disk
    does not keep that.

    ``update`` gets the image, if ``admission`` admits it, and whether to send one that the unit has already. The unit
    may be told to be at ``waypoints``.
    """

    def __init__(
        self,
        link: Link,
        status: Callable[[], UnitStatus],
        update: Callable[[Image, bool], None],
        admission: Admission,
        accept_room: Callable[[Callable[[CommandError | None], None]], None],
        waypoints: Number = limits.WAYPOINT,
    ) -> None:
        self._link, self._status, self._update, self._admission = link, status, update, admission
        self._accept_room, self._waypoints = accept_room, waypoints
        self._updating: _Command | None = None
        self._measuring = Measuring(link, status)
        self._ordered: dict[int, _Command] = {}
        self._await_settings: deque[_Command] = deque()

    def begin(self, name: str, request: CommandRequest, reply: Future[CommandReply]) -> None:
        """Carry out a command; ``reply`` says what became of it, when that is known."""
        command = _Command(name, request, reply)
        try:
            if name in AT_ONCE:
                self._end(command)
            elif name == ACCEPT_ROOM:
                self._accept_room(lambda error: self._end(command, error))
            elif self._updating is not None:
                raise UnderWayError()
            elif self._measuring.under_way and name not in (SETTINGS, STOP):
                raise CommandError(_MEASURING)
            elif name == UPDATE:
                self._begin_update(command)
            elif name == SETTINGS or name in procedure.COMMANDS or orders.needs_settings(name):
                self._begin_with_settings(command)
            else:
                if name == STOP:
                    self._measuring.give_up(CommandError("it was stopped"))
                self._ordered[self._link.order(orders.order(name, request, self._waypoints))] = command
        except GatewayError as error:
            self._end(command, error)

    def settings_read(self) -> None:
        """The link has read the unit's settings: go on with what waits for them."""
        waiting, self._await_settings = self._await_settings, deque()
        for command in waiting:
            self.begin(command.name, command.request, command.reply)

    def settled(self, event: OrderSettled) -> None:
        """Something became of an order."""
        self._measuring.settled(event)
        if event.ticket in self._ordered:
            self._end(self._ordered.pop(event.ticket), event.error)

    def status_read(self, status: Status) -> None:
        """The unit has told what it is doing."""
        self._measuring.status_read(status)

    def mechanics_read(self, mechanics: Mechanics) -> None:
        """The unit has told what it has found out about its mechanics."""
        self._measuring.mechanics_read(mechanics)

    def advance(self, now_s: float) -> None:
        """Time has passed; to be called once a second or so."""
        self._measuring.advance(now_s)

    def unit_was_reset(self) -> None:
        """The unit has restarted: it does not measure any more."""
        self._measuring.give_up(CommandError("the unit was reset"))

    def lost(self, why: str) -> None:
        """The unit can't be asked any more."""
        self._measuring.give_up(CommandError(why))
        waiting, self._await_settings = self._await_settings, deque()
        for command in waiting:
            self._end(command, CommandError(why))

    def updated(self, outcome: Ending, image: Image) -> None:
        """The update is over."""
        command, self._updating = self._updating, None
        assert command is not None
        failed = isinstance(outcome, GatewayError)
        command.reply.set_result(
            CommandReply(
                request_id=command.request.request_id,
                done=not failed,
                error=str(outcome) if failed else "",
                detail="" if failed else describe(outcome, image),
            )
        )

    def stopped(self, why: str) -> None:
        """The gateway ends, perhaps during an update."""
        command, self._updating = self._updating, None
        if command is not None:
            self._end(command, CommandError(f"{why}: update the unit again, it goes on where it was"))

    def _begin_update(self, command: _Command) -> None:
        if not command.request.image:
            raise CommandError("image is empty: give what the firmware's build/update.hex holds")
        self._update(self._admission.admit(command.request.image, "the image"), command.request.force)
        self._updating = command

    def _begin_with_settings(self, command: _Command) -> None:
        present = self._link.settings
        if not self._link.identified:
            raise CommandError("the unit is not connected: noctule units SITE says why")
        if present is None:
            self._await_settings.append(command)
        elif command.name == SETTINGS:
            self._end(command, known=present)
        elif command.name in procedure.COMMANDS:
            request = command.request
            self._measuring.begin(command.name, present, request.request_id, command.reply, time.monotonic())
        else:
            if (plan := self._link.plan_to_give) is not None:
                present = settings_message.with_plan(present, plan)
            order = orders.order_over(command.name, command.request, present)
            self._ordered[self._link.order(order)] = command

    def _end(self, command: _Command, error: GatewayError | None = None, known: Settings | None = None) -> None:
        command.reply.set_result(
            CommandReply(
                request_id=command.request.request_id,
                done=error is None,
                error="" if error is None else str(error),
                under_way=isinstance(error, UnderWayError),
                status=self._status(),
                measurements=self._measuring.latest if command.name in AT_ONCE else [],
                settings=None if known is None else settings_message.to_message(known),
            )
        )
