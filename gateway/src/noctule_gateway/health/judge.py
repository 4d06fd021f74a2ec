"""Judges a unit's sweeps one by one: what is wrong with the unit, since when and how sure, and when it is over.

A fault is named by the sweep that shows it for the ``named_after``-th time in a row, and is over after three sweeps in
a row that do not show it. A fixed unit's past learns only from sweeps that show nothing that spoils them.

A sweep of other bearings than the past's may be one that STOP has cut short, so it changes neither the past nor what
stands: only a second one in a row at the same bearings is another plan, and starts a new past.
"""

import math
from collections import deque
from dataclasses import dataclass, field, replace

from noctule import bounds
from noctule import messages_pb2 as messages
from noctule.messages_pb2 import FaultKind
from noctule_gateway.health import blocked, one_value, sensor_line, silence
from noctule_gateway.health.clock_slips import ClockSlips
from noctule_gateway.health.dead_bearing import DeadBearings
from noctule_gateway.health.past import Past, same_plan
from noctule_gateway.health.pose_watch import PoseWatch
from noctule_gateway.health.readings import Readings
from noctule_gateway.health.suspicion import Suspicion
from noctule_gateway.health.vocabulary import FAULTS

_OVER_AFTER = 3  # sweeps in a row that do not show it
_NATS_TO_BE_SURE = 15.0
_ODD_FOR_LONG = 60  # sweeps in a row that fit nothing and show nothing: the past is no longer this room's
_ODD_BEFORE = 3  # sweeps that are not well, right before those that show a fault: they count as its first
_BESIDE = frozenset({messages.FAULT_KIND_BEARING_SILENT, messages.FAULT_KIND_CLOCK_SLIPS})

StatedPose = tuple[float, ...]  # x and y in metres, heading in radians; empty for a unit that is carried


@dataclass(frozen=True)
class Finding:
    """A fault that was named."""

    kind: FaultKind
    since_ns: int  # start of the first sweep that shows it, UTC
    clock_epoch: str  # of that time
    confidence: float
    words: str
    absent: int = 0  # sweeps since that do not show it


@dataclass(frozen=True)
class Verdict:
    """Of one sweep: the faults that stand, those of them that spoil it, and how many sweeps before it are suspect."""

    findings: tuple[Finding, ...]
    spoiled_by: tuple[FaultKind, ...] = ()
    suspect_before: int = 0


@dataclass
class _Streak:
    """Sweeps that show one fault: the first, and how many were made ``before`` the present one."""

    first: Readings
    before: int
    count: int = 0
    nats: float = 0.0


@dataclass
class Memory:
    """What outlives the process: see memory_file.py."""

    pose: StatedPose = ()
    past: Past = field(default_factory=Past)
    usual: tuple[float, ...] = ()
    findings: tuple[Finding, ...] = ()


class Judge:
    """The judge of one unit; it takes its sweeps in the order in which they were made."""

    def __init__(self, memory: Memory | None = None) -> None:
        memory = memory or Memory()
        self._pose, self._past = memory.pose, memory.past
        self._watch = PoseWatch(memory.usual)
        self._findings = {each.kind: each for each in memory.findings}
        self._streaks: dict[FaultKind, _Streak] = {}
        self._slips, self._dead = ClockSlips(), DeadBearings()
        self._other_plan: Readings | None = None  # the sweep before, if it was not of the past's plan
        self._unwell = 0  # sweeps in a row before this one that show something, or fit nothing
        self._odd_before: deque[Readings] = deque(maxlen=_ODD_BEFORE)  # of them those that are not flagged
        self.revision = 0  # of the memory: goes up when it changes

    @property
    def memory(self) -> Memory:
        """What the next process needs to go on."""
        return Memory(self._pose, self._past, tuple(self._watch.usual), self.findings)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The faults that stand, the gravest first."""
        return tuple(self._findings[kind] for kind in FAULTS if kind in self._findings)

    @property
    def standing(self) -> Verdict:
        """The verdict on a sweep that can't be judged itself."""
        return Verdict(self.findings, tuple(each.kind for each in self.findings if FAULTS[each.kind].spoils))

    def judge(self, sweep: Readings, pose: StatedPose) -> Verdict:
        """Judge a sweep; ``pose`` is the stated one: at another a new past starts."""
        aside = self._is_aside(sweep, pose)
        past = self._past if sweep.fixed and self._past.is_enough and not aside else None
        found = self._suspicions(sweep, past)
        if aside:
            found = [each for each in found if FAULTS[each.kind].spoils]  # silence is none of a part of the bearings
        odd = any(FAULTS[each.kind].spoils for each in found) or (past is not None and self._watch.strange)
        named = self._count(found, sweep, odd or aside)
        before = [self._streaks[kind].before for kind in named if FAULTS[kind].spoils]
        if not aside:
            self._unwell = self._unwell + 1 if odd else 0
            if sweep.fixed:
                self._learn(sweep, found, odd)
        verdict = self.standing
        if verdict.spoiled_by or not (odd or aside):
            self._odd_before.clear()
        elif odd or self._odd_before:
            self._odd_before.append(sweep)
        # One more: the fault may have begun within it.
        return replace(verdict, suspect_before=min(max(before) + 1, bounds.MOST_SUSPECT) if before else 0)

    def accept_room(self) -> None:
        """What the unit hears from now on is right: forget its past, and the faults that rest on it."""
        self._begin_past(None, self._pose)
        self._findings = {kind: one for kind, one in self._findings.items() if kind not in _AGAINST_THE_PAST}
        self._streaks, self._other_plan, self._unwell = {}, None, 0
        self._odd_before.clear()
        self.revision += 1

    def _is_aside(self, sweep: Readings, pose: StatedPose) -> bool:
        """The past has nothing to say of this sweep. Starts a new past where the unit, its pose or its plan is
        another.
        """
        other, self._other_plan = self._other_plan, None
        if sweep.fixed and pose == self._pose and self._past.rows:
            if self._past.fits_plan(sweep):
                return False
            if other is None or not same_plan(sweep, other):
                self._other_plan = sweep
                return True
        if not (sweep.fixed and pose == self._pose and self._past.fits_plan(sweep)):
            self._begin_past(sweep, pose)
        return False

    def _suspicions(self, sweep: Readings, past: Past | None) -> list[Suspicion]:
        """The gravest kind that the sweep shows, and those that may stand beside it."""
        beside = self._slips.suspicions(sweep, past)
        if past is not None and not any(kind in _ELSEWHERE for kind in self._findings):
            beside += self._dead.suspicions(sweep, past)
        main = (
            sensor_line.suspicions(sweep)
            or one_value.suspicions(sweep, past)
            or blocked.suspicions(sweep, past)
            or silence.suspicions(sweep, past, self._watch.last)
        )
        arc = [each for each in main if each.kind == messages.FAULT_KIND_ARC_SILENT]
        spoiled = any(FAULTS[each.kind].spoils for each in main + beside if each not in arc)
        if past is None or not self._watch.take(sweep, past) or spoiled:
            return main + beside
        of_the_pose = self._watch.suspicions(past)
        if arc and any(each.kind == messages.FAULT_KIND_SLIPPED for each in of_the_pose):
            main = []  # a motor that slips may look past all that used to answer in an arc
        return (main or of_the_pose) + beside

    def _count(self, found: list[Suspicion], sweep: Readings, odd: bool) -> list[FaultKind]:
        """Go on with the streaks and the standing faults; the kinds that are named now."""
        for streak in self._streaks.values():
            streak.before += 1
        begun = _Streak(next(iter(self._odd_before), sweep), len(self._odd_before))
        shown = {each.kind: each for each in map(self._as_it_stands, found)}
        clear = any(FAULTS[kind].spoils for kind in shown)
        kept = self._streaks if odd and not clear else {}  # a sweep that shows nothing clearly proves nothing
        if self._watch.stands:  # what was heard proves that it has not moved
            kept.pop(messages.FAULT_KIND_MOVED, None)
        self._streaks = kept | {kind: self._streaks.get(kind) or replace(begun) for kind in shown}
        named: list[FaultKind] = []
        for kind, each in shown.items():
            streak = self._streaks[kind]
            streak.count, streak.nats = streak.count + 1, streak.nats + each.evidence
            if kind not in self._findings and _is_enough(kind, streak):
                self.revision += 1
                since_ns, epoch = streak.first.start_ns, streak.first.clock_epoch
                self._findings[kind] = Finding(kind, since_ns, epoch, _sure(kind, streak.nats), each.words)
                named.append(kind)
        for kind, finding in list(self._findings.items()):
            absent = 0 if kind in shown else finding.absent + (not odd)
            replaced = kind not in _BESIDE and any(other not in _BESIDE for other in named) and kind not in shown
            if absent >= _OVER_AFTER or replaced:
                self.revision += 1
                del self._findings[kind]
            else:
                self._findings[kind] = replace(finding, absent=absent)
        return named

    def _as_it_stands(self, found: Suspicion) -> Suspicion:
        """What slips or has play is also off by one angle for a while, and what was moved hears other things at other
        ranges: then this is what still stands.
        """
        causes = [kind for kind in _CAUSES.get(found.kind, ()) if kind in self._findings]
        return replace(found, kind=causes[0]) if causes else found

    def _learn(self, sweep: Readings, found: list[Suspicion], odd: bool) -> None:
        spoiled = any(FAULTS[kind].spoils for kind in self._findings)
        if not odd and not spoiled:
            if any(each.kind == messages.FAULT_KIND_NO_ECHO_ANYWHERE for each in found):
                return
            if self._past.rows:
                self._watch.learn_from(sweep, self._past)
            self.revision += self._past.add(sweep, but=self._dead.named)
        elif self._unwell >= _ODD_FOR_LONG and not spoiled:
            self._begin_past(sweep, self._pose)

    def _begin_past(self, sweep: Readings | None, pose: StatedPose) -> None:
        """With the bearings of ``sweep``; without any the next sweep says them."""
        if self._past.rows:
            self._findings = {kind: one for kind, one in self._findings.items() if kind not in _OF_THE_PLACE}
            self.revision += 1
        self._pose, self._past = pose, Past()
        if sweep is not None:
            self._past = Past(sweep.bearing_rad if sweep.fixed else (), air_measured=sweep.air_measured)
        self._watch = PoseWatch()
        self._dead.restart()


_OF_THE_PLACE = frozenset(
    {
        messages.FAULT_KIND_TURNED,
        messages.FAULT_KIND_MOVED,
        messages.FAULT_KIND_SLIPPED,
        messages.FAULT_KIND_PLAY,
        messages.FAULT_KIND_RANGES_JUMPED,
        messages.FAULT_KIND_TOO_NOISY,
        messages.FAULT_KIND_ARC_SILENT,
        messages.FAULT_KIND_BEARING_SILENT,
    }
)

_ELSEWHERE = frozenset(
    {
        messages.FAULT_KIND_TURNED,
        messages.FAULT_KIND_MOVED,
        messages.FAULT_KIND_SLIPPED,
        messages.FAULT_KIND_PLAY,
    }
)
"""While one of these stands, the unit looks elsewhere: its past says nothing of a single bearing."""

_CAUSES = {
    messages.FAULT_KIND_TURNED: (
        messages.FAULT_KIND_MOVED,
        messages.FAULT_KIND_SLIPPED,
        messages.FAULT_KIND_PLAY,
    ),
    messages.FAULT_KIND_SLIPPED: (messages.FAULT_KIND_MOVED,),
    messages.FAULT_KIND_RANGES_JUMPED: (messages.FAULT_KIND_MOVED,),
}
"""What looks like the first while one of the others stands is that other."""

_AGAINST_THE_PAST = _OF_THE_PLACE | {messages.FAULT_KIND_SILENT, messages.FAULT_KIND_BLOCKED}


def _is_enough(kind: FaultKind, streak: _Streak) -> bool:
    return streak.count >= FAULTS[kind].named_after and streak.nats >= FAULTS[kind].least_nats


def _sure(kind: FaultKind, nats: float) -> float:
    return FAULTS[kind].most_sure * (1 - math.exp(-nats / _NATS_TO_BE_SURE))
