"""What a gateway reports of a unit that it serves: on the bus as its status, in the log as one line."""

import logging
import time
from dataclasses import asdict, replace

from noctule.messages_pb2 import UnitStatus
from noctule_gateway.link.link import Link
from noctule_gateway.served_unit import ServedUnit
from noctule_gateway.status import unit_status
from noctule_gateway.status.service_quality import LineQuality
from noctule_gateway.status.unit_state import UnitState
from noctule_gateway.unit.sweep_intake import SweepIntake

_log = logging.getLogger(__name__)


class UnitReport:
    """Makes the unit's status of its state and of what its link, its intake and its log have counted."""

    def __init__(self, served: ServedUnit, link: Link, intake: SweepIntake) -> None:
        self._served = served
        self._link, self._intake = link, intake
        self._line_quality = LineQuality()
        self._told = UnitState().trouble
        self._answers, self._since_s = False, time.monotonic()

    def each_second(self, state: UnitState) -> UnitStatus:
        """The status that is due each second; what has changed for the operator goes to the log."""
        self._line_quality.note(self._link.counts.frames_read, self._link.counts.frames_bad)
        message = self.message(state)
        if not state.update:
            self._tell(message.detail)
        return message

    def message(self, state: UnitState) -> UnitStatus:
        """The unit's status."""
        known = replace(
            state,
            log=self._served.log.state,
            setup_error=self._link.setup_error,
            lost_pose=self._intake.lost_pose,
            late=self._intake.late,
            bad_line=self._line_quality.bad,
            faults=tuple(self._intake.faults),
        )
        message = unit_status.message(known, self._served.unit)
        message.site = self._served.site.name
        message.time.FromNanoseconds(time.time_ns())
        message.since.FromMilliseconds(round(1000 * self._since_utc_s(answers=not known.trouble)))
        if (logged_s := self._intake.last_sweep_utc_s()) is not None:
            message.last_sweep.FromMilliseconds(round(1000 * logged_s))
        message.clock_error_s, message.clock_drift = self._intake.clock_error_s, self._intake.clock_drift
        message.counters.update(self._counters(known))
        return message

    def _since_utc_s(self, answers: bool) -> float:
        """Since when the unit has answered, or has not, by the clock as it is now: it may have been wrong then."""
        now_s = time.monotonic()
        if answers != self._answers:
            self._answers, self._since_s = answers, now_s
        return time.time() - (now_s - self._since_s)

    def _counters(self, state: UnitState) -> dict[str, int]:
        intake = self._intake
        return {
            "sweeps_committed": intake.committed,
            "sweeps_without_pose": intake.without_pose,
            "sweeps_flagged": intake.flagged,
            "lines_opened": state.lines_opened,
            "clocks_refused": intake.clocks_refused,
            "poses_refused": self._served.track.refused,
            "late_ms": round(1000 * intake.worst_lateness_s),
            "log_bytes": state.log.size_bytes,
            **asdict(self._link.counts),
            **(unit_status.unit_counters(state.status) if state.status else {}),
        }

    def _tell(self, detail: str) -> None:
        if detail and detail != self._told:
            _log.warning("%s: %s", self._served.unit.name, detail)
        elif self._told and not detail:
            _log.info("%s: all is well", self._served.unit.name)
        self._told = detail
