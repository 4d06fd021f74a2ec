"""One unit served: acts on what its link tells. Sweeps go to the log, then to the bus and back as acknowledgements."""

import hashlib
import logging
import random
import time
from collections.abc import Callable
from concurrent.futures import Future

from noctule.messages_pb2 import CommandReply, CommandRequest, UnitStatus
from noctule.site import Site, Unit
from noctule_gateway import orders, resets, status
from noctule_gateway.boots import Anchor, BootClocks
from noctule_gateway.codec import encode
from noctule_gateway.errors import LineError, LogError
from noctule_gateway.events import (
    ClockRead,
    Event,
    Identified,
    InLoader,
    OrderSettled,
    Refused,
    SettingsRead,
    Silent,
    StatusRead,
    SweepRead,
)
from noctule_gateway.execution import Execution
from noctule_gateway.frames import MAX_REQUEST, Hello, Loader, Status, Sweep
from noctule_gateway.lateness import TOO_LATE_S, Lateness
from noctule_gateway.line import Line
from noctule_gateway.line_quality import LineQuality
from noctule_gateway.link import Link
from noctule_gateway.log import SweepLog
from noctule_gateway.log_file import Arrival, Committed
from noctule_gateway.pose import PoseTrack, pose_of_sweep
from noctule_gateway.setup import Wanted
from noctule_gateway.sweep import to_message, waypoint_of

REPORT_EVERY_S = 1.0

_log = logging.getLogger(__name__)


class UnitServer:
    """Serves ``unit`` from start() to stop(); its thread is the line's.

    ``publish`` is called with each sweep's record after its commit, ``report`` with the unit's status each second and
    when it changes; neither may block. Raises CommandError if the site file's plan does not fit a unit.
    """

    def __init__(
        self,
        site: Site,
        unit: Unit,
        log: SweepLog,
        track: PoseTrack,
        publish: Callable[[bytes], None],
        report: Callable[[UnitStatus], None],
    ) -> None:
        self._site, self._unit, self._sweep_log, self._track = site, unit, log, track
        self._publish, self._report = publish, report
        plan = orders.configure(unit.plan, orders.DEFAULT_PLAN) if unit.plan else None
        wanted = Wanted(plan, orders.start(unit.pause_s), unit.start)
        self._link = Link(unit.serial, wanted, first_request=random.randrange(MAX_REQUEST))
        self._clocks = BootClocks(site.clock == "unit", self._anchor)
        self._execution = Execution(self._link, self._status_message)
        self._lateness = Lateness()
        self._line_quality = LineQuality()
        self._counters = dict.fromkeys(("sweeps_committed", "sweeps_without_pose", "lines_opened", "clocks_refused"), 0)
        self._trouble = "not connected yet"
        self._hello: Hello | None = None
        self._loader: Loader | None = None
        self._status: Status | None = None
        self._lost_pose = False
        self._told = self._trouble
        self._report_due_s = 0.0
        self._line = Line(unit.address, self, unit.name)

    def start(self) -> None:
        """Begin to serve the unit."""
        self._line.start()

    def stop(self) -> None:
        """Serve it no more, soon. What is on its way to the log is still committed."""
        self._line.stop()

    def join(self) -> None:
        """Wait for the end after stop()."""
        self._line.join()
        self._trouble = "the gateway that served it was stopped"
        self._report(self._status_message())

    def command(self, name: str, request: CommandRequest) -> Future[CommandReply]:
        """Carry out a command of the bus; the reply says what went wrong. From any thread."""
        future: Future[CommandReply] = Future()
        self._line.call(lambda: self._execution.begin(name, request, future))
        return future

    @property
    def late(self) -> bool:
        """Its sweeps are acknowledged later than they should be: the machine can't keep up."""
        return self._lateness.worst_s > TOO_LATE_S

    @property
    def connected(self) -> bool:
        """The unit answers, and is the one expected."""
        return self._link.identified

    # ---- The line's thread, as line.Talker ----

    @property
    def next_s(self) -> float:
        """When the link or the next report is due."""
        return min(self._link.next_s, self._report_due_s)

    def opened(self, now_s: float) -> None:
        """Greet whoever is there."""
        self._counters["lines_opened"] += 1
        self._handle(self._link.connected(now_s))
        self._lose(f"no answer on {self._unit.address}")
        self._report_due_s = now_s + REPORT_EVERY_S  # most units answer before that needs telling

    def closed(self, error: LineError, now_s: float) -> None:
        """Tell why there is no line."""
        self._handle(self._link.connected(now_s))
        self._lose(str(error))

    def receive(self, data: bytes, now_s: float) -> None:
        """Hand what has come to the link."""
        self._handle(self._link.receive(data, now_s))

    def advance(self, now_s: float) -> None:
        """Time-outs, and the report of each second."""
        self._handle(self._link.advance(now_s))
        if now_s >= self._report_due_s:
            self._report_due_s = now_s + REPORT_EVERY_S
            self._line_quality.note(self._link.reader.frames_read, self._link.reader.frames_bad)
            report = self._status_message()
            self._tell(report.detail)
            self._report(report)

    def output(self, now_s: float) -> bytes:
        """What the link has to say."""
        return self._link.output(now_s)

    # ---- What the link tells ----

    def _handle(self, events: list[Event]) -> None:
        for event in events:
            match event:
                case Identified():
                    self._identified(event)
                case Refused(error):
                    self._lose(str(error))
                case InLoader(loader):
                    self._lose(status.in_loader(loader, self._unit), loader)
                case Silent():
                    self._lose(f"no answer on {self._unit.address}")
                case ClockRead(exchange):
                    self._counters["clocks_refused"] += not self._clocks.add(exchange)
                case StatusRead(read):
                    changed = self._status is None or read.state != self._status.state
                    self._status = read
                    self._report_due_s = 0.0 if changed else self._report_due_s
                case SettingsRead():
                    self._execution.settings_read()
                case SweepRead(sweep):
                    self._commit(sweep)
                case OrderSettled():
                    self._execution.settled(event)

    def _identified(self, event: Identified) -> None:
        hello, name = event.hello, self._unit.name
        _log.info("%s: unit %d, firmware %s, boot %d", name, hello.serial, hello.version, hello.boot)
        if event.rebooted and (warning := resets.warning(hello, met_before=self._hello is not None)):
            _log.warning("%s has started anew: %s", name, warning)
        self._hello, self._loader = hello, None
        self._clocks.begin(hello.boot, time.monotonic(), _utc_offset_s())
        self._trouble = ""
        self._report_due_s = 0.0

    def _lose(self, why: str, loader: Loader | None = None) -> None:
        """The unit can't be asked for anything, until it is identified again."""
        self._trouble, self._loader = why, loader
        self._execution.lost(why)
        self._report_due_s = 0.0

    def _commit(self, sweep: Sweep) -> None:
        start = self._clocks.at(sweep.boot, sweep.start, _utc_offset_s())
        pose = pose_of_sweep(self._unit.pose, waypoint_of(sweep), start.time_s, self._track)
        self._lost_pose = pose is None
        drift = self._clocks.good_drift(sweep.boot)
        message = to_message(sweep, self._site, self._unit, start, pose, drift)
        arrived_s = time.monotonic()
        digest = hashlib.blake2b(encode(sweep), digest_size=16).digest()

        def done(result: Committed | LogError) -> None:
            if isinstance(result, Committed) and result.fresh:
                self._publish(result.record)
            self._line.call(lambda: self._committed(sweep, result, arrived_s, placed=pose is not None))

        self._sweep_log.append(Arrival(digest, sweep.start, message), done)

    def _committed(self, sweep: Sweep, result: Committed | LogError, arrived_s: float, placed: bool) -> None:
        now_s = time.monotonic()
        self._lateness.note(now_s - arrived_s, now_s)
        if isinstance(result, LogError):
            self._link.failed(sweep)
            return
        self._link.committed(sweep)
        self._counters["sweeps_committed"] += result.fresh
        self._counters["sweeps_without_pose"] += result.fresh and not placed

    # ---- What is told of the unit ----

    def _tell(self, detail: str) -> None:
        if detail and detail != self._told:
            _log.warning("%s: %s", self._unit.name, detail)
        elif self._told and not detail:
            _log.info("%s: all is well", self._unit.name)
        self._told = detail

    def _status_message(self) -> UnitStatus:
        condition = status.Condition(
            trouble=self._trouble,
            hello=self._hello,
            loader=self._loader,
            status=self._status,
            log=self._sweep_log.state,
            setup_error=self._link.setup.error,
            lost_pose=self._lost_pose,
            late=self.late,
            bad_line=self._line_quality.bad,
        )
        message = status.message(condition, self._unit)
        message.site = self._site.name
        message.time.FromNanoseconds(time.time_ns())
        message.clock_error_s = self._clocks.error_s
        message.clock_drift = self._clocks.drift
        message.counters.update(self._all_counters())
        return message

    def _all_counters(self) -> dict[str, int]:
        link = self._link
        return {
            **self._counters,
            "frames_read": link.reader.frames_read,
            "frames_bad": link.reader.frames_bad,
            "frames_unknown": link.reader.frames_unknown,
            "sweeps_repeated": link.receipts.duplicates,
            "requests_unanswered": link.timeouts,
            "poses_refused": self._track.refused,
            "late_ms": round(1000 * self._lateness.worst_s),
            "log_bytes": self._sweep_log.state.size_bytes,
            **(status.unit_counters(self._status) if self._status else {}),
        }

    def _anchor(self, boot: int) -> Anchor | None:
        try:
            return self._sweep_log.last_of_boot(boot)
        except LogError:
            return None  # its trouble is shown in the status; the exchanges tell the time without it


def _utc_offset_s() -> float:
    return time.time() - time.monotonic()
