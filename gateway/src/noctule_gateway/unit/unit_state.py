"""What a gateway knows of a unit that it serves, and tells of it: on the bus as its status, in the log as one line."""

import logging
import time

from noctule.messages_pb2 import UnitStatus
from noctule.site import Site, Unit
from noctule_gateway.link.link import Link
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.status import unit_status
from noctule_gateway.status.health import LineQuality
from noctule_gateway.unit.sweep_intake import SweepIntake
from noctule_gateway.wire.frames import Hello, Loader, Status

_log = logging.getLogger(__name__)


class UnitState:
    """The latest of what the unit has said of itself, and why it says nothing.

    ``trouble`` is why it does not answer, empty while it does; ``update`` how far an update is, empty while there is
    none; ``loader`` is None unless it sits there.
    """

    def __init__(
        self, site: Site, unit: Unit, log: SweepLog, track: PoseTrack, link: Link, intake: SweepIntake
    ) -> None:
        self.trouble = self._told = "not connected yet"
        self.update = ""
        self.hello: Hello | None = None
        self.loader: Loader | None = None
        self.status: Status | None = None
        self.lines_opened = self.clocks_refused = 0
        self._site, self._unit, self._sweep_log, self._track = site, unit, log, track
        self._link, self._intake = link, intake
        self._line_quality = LineQuality()

    def report(self) -> UnitStatus:
        """The status that is due each second; what has changed for the operator goes to the log."""
        self._line_quality.note(self._link.reader.frames_read, self._link.reader.frames_bad)
        message = self.message()
        if not self.update:
            self._tell(message.detail)
        return message

    def message(self) -> UnitStatus:
        """The unit's status."""
        clocks = self._intake.clocks
        message = unit_status.message(self._condition(), self._unit)
        message.site = self._site.name
        message.time.FromNanoseconds(time.time_ns())
        message.clock_error_s, message.clock_drift = clocks.error_s, clocks.drift
        message.counters.update(self._counters())
        return message

    def _condition(self) -> unit_status.Condition:
        return unit_status.Condition(
            trouble=self.trouble,
            update=self.update,
            hello=self.hello,
            loader=self.loader,
            status=self.status,
            log=self._sweep_log.state,
            setup_error=self._link.standing_orders.error,
            lost_pose=self._intake.lost_pose,
            late=self._intake.lateness.too_late(time.monotonic()),
            bad_line=self._line_quality.bad,
        )

    def _counters(self) -> dict[str, int]:
        link, intake = self._link, self._intake
        return {
            "sweeps_committed": intake.committed,
            "sweeps_without_pose": intake.without_pose,
            "lines_opened": self.lines_opened,
            "clocks_refused": self.clocks_refused,
            "frames_read": link.reader.frames_read,
            "frames_bad": link.reader.frames_bad,
            "frames_unknown": link.reader.frames_unknown,
            "sweeps_repeated": link.receipts.duplicates,
            "requests_unanswered": link.timeouts,
            "poses_refused": self._track.refused,
            "late_ms": round(1000 * intake.lateness.worst_s(time.monotonic())),
            "log_bytes": self._sweep_log.state.size_bytes,
            **(unit_status.unit_counters(self.status) if self.status else {}),
        }

    def _tell(self, detail: str) -> None:
        if detail and detail != self._told:
            _log.warning("%s: %s", self._unit.name, detail)
        elif self._told and not detail:
            _log.info("%s: all is well", self._unit.name)
        self._told = detail
