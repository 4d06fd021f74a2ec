"""Judges a unit's sweeps on their way to the log: a sweep carries what its gateway had found when it came."""

import logging
from collections import OrderedDict
from pathlib import Path

from noctule.messages_pb2 import Sweep, UnitFault
from noctule.site import FixedPose, Unit, UnknownPose
from noctule_gateway.errors import CommandError
from noctule_gateway.health import memory_file
from noctule_gateway.health.judge import Finding, Judge, Memory, Verdict
from noctule_gateway.health.readings import readings_of
from noctule_gateway.health.vocabulary import FAULTS

_KEPT_VERDICTS = 100  # more than a unit's ring holds: it sends a sweep again until it is acknowledged

_log = logging.getLogger(__name__)


class SweepHealth:
    """The judge of one unit, with the file of its memory. For the line's thread, but ``save``."""

    def __init__(self, unit: Unit, site: str, log: Path) -> None:
        self._unit, self._site, self._path = unit, site, memory_file.path_for(log)
        self._fixed = isinstance(unit.pose, FixedPose | UnknownPose)
        self._verdicts: OrderedDict[bytes, Verdict] = OrderedDict()
        self._judge = Judge(self._remembered())
        self._judge_trouble = self._saved_trouble = self._unsaved = False
        self._revision = 0
        self.flagged = 0  # sweeps that carried a fault

    def judge(self, sweep: Sweep, digest: bytes) -> None:
        """Write into ``sweep`` what is wrong with the unit. One of the same ``digest`` is judged as it was."""
        verdict = self._verdicts.get(digest)
        if verdict is None:
            verdict = self._verdicts[digest] = self._judged(sweep)
            self.flagged += bool(verdict.spoiled_by)
            while len(self._verdicts) > _KEPT_VERDICTS:
                self._verdicts.popitem(last=False)
        sweep.faults.extend(verdict.spoiled_by)
        sweep.suspect_before = verdict.suspect_before

    def faults(self, clock_epoch: str) -> list[UnitFault]:
        """What stands, for the unit's status; with since when, if that was told under the clock's present epoch."""
        return [self._message(one, clock_epoch) for one in self._judge.findings]

    def accept_room(self) -> None:
        """What the unit hears from now on is right. Raises CommandError for a unit that is carried."""
        if not self._fixed:
            raise CommandError("the unit is carried, so the gateway compares its sweeps with none before them")
        self._judge.accept_room()
        self._verdicts.clear()

    def memory(self) -> str | None:
        """What ``save`` is to keep; None where nothing has changed since it was kept."""
        if self._judge.revision == self._revision and not self._unsaved:
            return None
        self._revision, self._unsaved = self._judge.revision, False
        return memory_file.to_text(self._judge.memory)

    def save(self, memory: str) -> bool:
        """Keep the memory; False where that fails: a restart goes by the one before, unless a later sweep's is kept.

        For the log's thread: it may wait for the disk.
        """
        try:
            memory_file.write(self._path, memory)
            self._saved_trouble = False
            return True
        except OSError as error:
            if not self._saved_trouble:
                _log.warning(
                    "%s: the health file can't be written; after a restart the gateway learns again: %s",
                    self._unit.name,
                    error,
                )
            self._saved_trouble = self._unsaved = True
            return False

    def _remembered(self) -> Memory:
        try:
            return memory_file.read(self._path)
        except (OSError, ValueError) as error:
            _log.warning(
                "%s: %s can't be read; the gateway learns again what the unit hears: %s",
                self._unit.name,
                self._path,
                error,
            )
            return Memory()

    def _judged(self, sweep: Sweep) -> Verdict:
        pose = (sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad) if self._fixed else ()
        try:
            return self._judge.judge(readings_of(sweep, self._fixed), pose)
        except Exception:  # whatever is wrong with the judge, the sweep must be kept
            if not self._judge_trouble:
                _log.exception("%s: a sweep could not be judged; it is kept unjudged", self._unit.name)
            self._judge_trouble = True
            return self._judge.standing

    def _message(self, finding: Finding, clock_epoch: str) -> UnitFault:
        advice = FAULTS[finding.kind].advice.replace("SITE UNIT", f"{self._site} {self._unit.name}")
        fault = UnitFault(kind=finding.kind, confidence=finding.confidence, words=finding.words, advice=advice)
        if finding.clock_epoch == clock_epoch:
            fault.since.FromNanoseconds(finding.since_ns)
        return fault
