"""One unit served: its link, or an update of it, speaks on its line, and what comes of that goes where it belongs."""

import logging
import random
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus
from noctule_gateway.errors import BEING_UPDATED, CommandError, GatewayError, LineError
from noctule_gateway.line.line import Line
from noctule_gateway.link.events import (
    ClockRead,
    Event,
    Identified,
    InLoader,
    MechanicsRead,
    OrderSettled,
    Refused,
    SettingsRead,
    Silent,
    StatusRead,
    SweepRead,
)
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.served_unit import ServedUnit
from noctule_gateway.status import reset_causes, unit_status
from noctule_gateway.status.hearing import Hearing
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.turns.keeper import TurnKeeper
from noctule_gateway.unit.command_runner import CommandRunner
from noctule_gateway.unit.plans import wanted_plan
from noctule_gateway.unit.sweep_intake import SweepIntake
from noctule_gateway.unit.unit_report import UnitReport
from noctule_gateway.update.admission import Admission
from noctule_gateway.update.image import Image
from noctule_gateway.update.outcome import Current, Ending, describe
from noctule_gateway.update.updater import Updater
from noctule_gateway.wire import limits, orders, settings_message
from noctule_gateway.wire.frames import MAX_REQUEST, Loader, Start

REPORT_EVERY_S = 1.0
REOPEN_AFTER_S = 10.0  # of silence though asked: a connection may be dead at one end only

_STOPPED = "the gateway that served it was stopped"

_log = logging.getLogger(__name__)


class UnitServer:
    """Serves a unit from start() to stop(); its thread is the line's.

    ``publish`` is called with each sweep's record after its commit, ``report`` with the unit's status each second and
    when it changes; neither may block. ``admission`` says which firmware it may get.
    Raises CommandError if the site file's plan does not fit a unit.
    """

    def __init__(
        self,
        served: ServedUnit,
        publish: Callable[[bytes], None],
        report: Callable[[UnitStatus], None],
        admission: Admission,
    ) -> None:
        self._site, self._unit, self._report = served.site, served.unit, report
        unit = served.unit
        wanted = Wanted(wanted_plan(unit), orders.start(unit.pause_s), unit.start)
        self._line = Line(unit.address, self, unit.name)
        self._turns, self._not_reckoned_with = TurnKeeper(served.turn), served.not_reckoned_with
        self._link = Link(unit.serial, wanted, random.randrange(MAX_REQUEST), self._in_turn)
        self._intake = SweepIntake(served, self._link, publish, self._line.call)
        self._state = UnitState()
        self._unit_report = UnitReport(served, self._link, self._intake)
        waypoints = limits.waypoints_of(unit.pose)
        self._commands = CommandRunner(
            self._link, self._status, self._begin_update, admission, self._accept_room, waypoints
        )
        self._updater: Updater | None = None  # has the line in place of the link
        self._line_is_open = self._is_over = False
        self._report_due_s = 0.0
        self._hearing = Hearing(unit.address)

    def start(self) -> None:
        """Begin to serve the unit."""
        self._line.start()

    def stop(self) -> None:
        """Serve it no more, soon. What is on its way to the log is still committed."""
        self._line.stop()

    def join(self, by_s: float) -> None:
        """Wait for the end after stop(), until ``by_s`` (monotonic): a line that hangs then is left behind."""
        if not self._line.join(max(0.0, by_s - time.monotonic())):
            _log.warning("%s: the line hangs and was left as it is: %s", self._unit.name, self._unit.address)
            return
        self._handle(self._link.connected(time.monotonic(), _STOPPED))
        self._lose(_STOPPED)
        self._commands.stopped(_STOPPED)
        self._state = self._state.updating("")
        self._report(self._status())
        self._is_over = True

    def command(self, name: str, request: CommandRequest) -> Future[CommandReply]:
        """Carry out a command of the bus; the reply says what went wrong. From any thread."""
        future: Future[CommandReply] = Future()
        if self._is_over:  # a command may have waited for the audit log
            future.set_result(CommandReply(request_id=request.request_id, error=_STOPPED))
        else:
            self._line.call(lambda: self._commands.begin(name, request, future))
        return future

    @property
    def late(self) -> bool:
        """Its sweeps are acknowledged later than they should be: the machine can't keep up."""
        return self._intake.late

    @property
    def connected(self) -> bool:
        """The unit answers, and is the one expected."""
        return self._link.identified

    @property
    def updating(self) -> bool:
        """Its firmware is being updated."""
        return self._updater is not None

    # ---- The line's thread, as line.Talker ----

    @property
    def next_s(self) -> float:
        """When the link, or the update, or the next report is due."""
        return min(self._link.next_s if self._updater is None else self._updater.next_s, self._report_due_s)

    def opened(self, now_s: float) -> None:
        """Greet the unit at the other end."""
        self._line_is_open = True
        self._hearing.opened(now_s)
        self._state = self._state.line_opened()
        self._greet(now_s)
        if self._updater is not None:
            self._updater.opened(now_s)

    def closed(self, error: LineError, now_s: float) -> None:
        """Tell why there is no line."""
        self._line_is_open = False
        self._handle(self._link.connected(now_s))
        self._lose(str(error))
        if self._updater is not None:
            self._updater.closed(error, now_s)

    def receive(self, data: bytes, now_s: float) -> None:
        """Hand what has come to the link, or to the update."""
        self._hearing.heard(now_s)
        if self._updater is None:
            self._handle(self._link.receive(data, now_s))
        else:
            self._updater.receive(data, now_s)

    def advance(self, now_s: float) -> None:
        """Time-outs, and the report of each second. Raises LineError if the line is to be opened again."""
        if self._updater is None:
            self._handle(self._link.advance(now_s))
            self._give_up_silent_line(now_s)
        else:
            self._advance_update(self._updater, now_s)
        if now_s >= self._report_due_s:
            self._report_due_s = now_s + REPORT_EVERY_S
            self._commands.advance(now_s)
            if self._turns.look(self._intake.clock_line, now_s):
                self._link.start_again()
            self._state = self._hearing.up_to_date(self._state, self._link.counts)
            self._state = replace(self._state, out_of_turn=self._turns.trouble(now_s))
            self._report(self._unit_report.each_second(self._state))

    def _give_up_silent_line(self, now_s: float) -> None:
        if self._line_is_open and not self._link.identified and self._hearing.silent_s(now_s) >= REOPEN_AFTER_S:
            raise LineError(self._hearing.words(self._link.counts))

    def output(self, now_s: float) -> bytes:
        """What the link, or the update, has to say."""
        return self._link.output(now_s) if self._updater is None else self._updater.output(now_s)

    def _in_turn(self, start: Start, now_s: float) -> Start:
        return self._turns.start(start, self._intake.clock_line, now_s)

    def _status(self) -> UnitStatus:
        return self._unit_report.message(self._state)

    def _greet(self, now_s: float) -> None:
        self._handle(self._link.connected(now_s))
        self._lose(self._hearing.begin(self._link.counts))
        self._report_due_s = now_s + REPORT_EVERY_S  # most units answer before that needs telling

    # ---- What the link tells ----

    def _handle(self, events: list[Event]) -> None:
        for event in events:
            match event:
                case Identified():
                    self._identified(event)
                case Refused(error):
                    self._lose(str(error))
                case InLoader(loader):
                    self._lose(unit_status.in_loader(loader, self._unit, self._site.name), loader)
                case Silent():
                    self._lose(self._hearing.begin(self._link.counts))
                case ClockRead(exchange):
                    self._intake.clock_read(exchange)
                case StatusRead(read):
                    changed = self._state.status is None or read.state != self._state.status.state
                    self._state = self._state.said(read)
                    self._turns.said(read)
                    self._intake.status_read(read)
                    self._report_due_s = 0.0 if changed else self._report_due_s
                    self._commands.status_read(read)
                case MechanicsRead(mechanics):
                    self._state = self._state.measured(mechanics)
                    self._intake.checked(mechanics)
                    self._commands.mechanics_read(mechanics)
                    self._report_due_s = 0.0
                case SettingsRead():
                    self._look_at_plan()
                    self._commands.settings_read()
                case SweepRead(sweep):
                    self._intake.take(sweep)
                case OrderSettled():
                    self._commands.settled(event)

    def _look_at_plan(self) -> None:
        """Whether the turns reckon with the plan that the unit has, or is about to get."""
        settings = self._link.settings
        if settings is not None:
            plan = self._link.plan_to_give or settings_message.plan_of(settings)
            self._turns.goes_by(self._not_reckoned_with(plan))

    def _identified(self, event: Identified) -> None:
        hello, name = event.hello, self._unit.name
        _log.info("%s: unit %d, firmware %s, boot %d", name, hello.serial, hello.version, hello.boot)
        if event.rebooted and (warning := reset_causes.warning(hello, met_before=self._state.hello is not None)):
            _log.warning("%s has restarted: %s", name, warning)
        if event.rebooted:
            self._commands.unit_was_reset()
        self._state = self._state.identified(hello)
        self._intake.begin_boot(hello.boot_of_life)
        self._turns.met(hello, time.monotonic())
        self._report_due_s = 0.0

    def _lose(self, why: str, loader: Loader | None = None) -> None:
        """The unit can't be asked for anything, until it is identified again."""
        self._state = self._state.lost(why, loader)
        self._commands.lost(why)
        self._report_due_s = 0.0

    def _accept_room(self, done: Callable[[CommandError | None], None]) -> None:
        self._intake.accept_room(done)
        _log.info("%s: its room is accepted as it is: the gateway learns again what the unit hears", self._unit.name)

    # ---- An update, which has the line until it is over ----

    def _begin_update(self, image: Image, again: bool) -> None:
        if not self._line_is_open:
            raise CommandError(self._state.trouble)
        now_s = time.monotonic()
        self._handle(self._link.connected(now_s, BEING_UPDATED))
        self._lose(BEING_UPDATED)
        self._updater = Updater(self._unit.serial, image, again, random.randrange(MAX_REQUEST))
        self._updater.opened(now_s)
        _log.info("%s: its firmware is being updated to %s; %s", self._unit.name, image.version_text, image.signer)

    def _advance_update(self, updater: Updater, now_s: float) -> None:
        updater.advance(now_s)
        self._state = self._state.updating(f"updating: {updater.progress}")
        if updater.outcome is not None:
            self._updater, self._state = None, self._state.updating("")
            self._end_update(updater.image, updater.outcome, now_s)

    def _end_update(self, image: Image, outcome: Ending, now_s: float) -> None:
        failed = isinstance(outcome, GatewayError)
        _log.log(
            logging.WARNING if failed else logging.INFO,
            "%s: %s: %s",
            self._unit.name,
            "its firmware was not updated" if failed else "the update is over",
            describe(outcome, image),
        )
        if not isinstance(outcome, Current):
            self._link.set_up_again()
        if self._line_is_open:
            self._greet(now_s)
        self._commands.updated(outcome, image)
