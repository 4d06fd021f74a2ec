"""Judges a unit's sweeps on their way to the log: a sweep carries what its gateway had found when it came."""

import logging
from collections import OrderedDict
from pathlib import Path

from noctule.messages_pb2 import Sweep, UnitFault
from noctule.site import FixedPose, Unit, UnknownPose
from noctule_gateway.health import memory_file
from noctule_gateway.health.judge import Finding, Judge, Memory, Verdict
from noctule_gateway.health.look import look_of
from noctule_gateway.health.vocabulary import FAULTS

_KEPT_VERDICTS = 100  # a unit's ring holds 24 sweeps, and sends one again until it is acknowledged

_log = logging.getLogger(__name__)


class SweepHealth:
    """The judge of one unit, with the file of its memory. For the line's thread, but ``save``."""

    def __init__(self, unit: Unit, site: str, log: Path) -> None:
        self._unit, self._site, self._path = unit, site, memory_file.path_for(log)
        self._fixed = isinstance(unit.pose, FixedPose | UnknownPose)
        self._verdicts: OrderedDict[tuple[int, int, int], Verdict] = OrderedDict()
        self._judge = Judge(self._remembered())
        self._saved_trouble, self._revision = False, 0
        self.flagged = 0  # sweeps that carried a fault

    def judge(self, sweep: Sweep) -> None:
        """Write into ``sweep`` what is wrong with the unit. One that comes again is judged as it was."""
        identity = (sweep.life, sweep.boot, sweep.sequence)
        verdict = self._verdicts.get(identity)
        if verdict is None:
            place = (sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad) if self._fixed else ()
            verdict = self._verdicts[identity] = self._judge.judge(look_of(sweep, self._fixed), place)
            self.flagged += bool(verdict.spoiled_by)
            while len(self._verdicts) > _KEPT_VERDICTS:
                self._verdicts.popitem(last=False)
        sweep.faults.extend(verdict.spoiled_by)
        sweep.suspect_before = verdict.suspect_before

    def faults(self) -> list[UnitFault]:
        """What stands, for the unit's status."""
        return [self._message(one) for one in self._judge.findings]

    def memory(self) -> str | None:
        """What ``save`` is to keep; None where nothing has changed."""
        if self._judge.revision == self._revision:
            return None
        self._revision = self._judge.revision
        return memory_file.to_json(self._judge.memory)

    def save(self, memory: str) -> None:
        """Keep the memory; where that fails, a restart learns again. For the log's thread: it may wait for the disk."""
        try:
            memory_file.write(self._path, memory)
            self._saved_trouble = False
        except OSError as error:
            if not self._saved_trouble:
                _log.warning("%s: what its sweeps have taught can't be kept: %s", self._unit.name, error)
            self._saved_trouble = True

    def _remembered(self) -> Memory:
        try:
            return memory_file.read(self._path)
        except (OSError, ValueError) as error:
            _log.warning("%s: %s can't be read and is begun anew: %s", self._unit.name, self._path, error)
            return Memory()

    def _message(self, finding: Finding) -> UnitFault:
        advice = FAULTS[finding.kind].advice.replace("SITE UNIT", f"{self._site} {self._unit.name}")
        fault = UnitFault(kind=finding.kind, confidence=finding.confidence, words=finding.words, advice=advice)
        fault.since.FromNanoseconds(finding.since_ns)
        return fault
