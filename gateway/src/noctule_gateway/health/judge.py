"""Judges a unit's sweeps one by one: what is wrong with the unit, since when and how sure, and when it is over.

A fault is named by the sweep that shows it for the ``named_after``-th time in a row, and is over after three sweeps in
a row that do not show it. A fixed unit's past learns only from sweeps that show nothing.
"""

import math
from dataclasses import dataclass, field, replace

from noctule import messages_pb2 as messages
from noctule.messages_pb2 import FaultKind
from noctule_gateway.health import blocked, one_value, sensor_line, silence
from noctule_gateway.health.clock_slips import ClockSlips
from noctule_gateway.health.dead_bearing import DeadBearings
from noctule_gateway.health.look import Look
from noctule_gateway.health.past import Past
from noctule_gateway.health.place import PlaceWatch
from noctule_gateway.health.suspicion import Suspicion
from noctule_gateway.health.vocabulary import FAULTS

_OVER_AFTER = 3  # sweeps in a row that do not show it
_NATS_TO_BE_SURE = 15.0
_ODD_FOR_LONG = 60  # sweeps in a row that fit nothing and show nothing: the past is no longer this room's
_BESIDE = frozenset({messages.FAULT_KIND_BEARING_SILENT, messages.FAULT_KIND_CLOCK_SLIPS})

Place = tuple[float, ...]


@dataclass(frozen=True)
class Finding:
    """A fault that was named."""

    kind: FaultKind
    since_ns: int  # start of the first sweep that shows it, UTC
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
    since_ns: int
    count: int = 0
    nats: float = 0.0


@dataclass
class Memory:
    """What outlives the process: see memory_file.py."""

    place: Place = ()
    past: Past = field(default_factory=Past)
    usual: tuple[float, ...] = ()
    findings: tuple[Finding, ...] = ()


class Judge:
    """The judge of one unit; it takes its sweeps in the order in which they were made."""

    def __init__(self, memory: Memory | None = None) -> None:
        memory = memory or Memory()
        self._place, self._past = memory.place, memory.past
        self._watch = PlaceWatch(memory.usual)
        self._findings = {each.kind: each for each in memory.findings}
        self._streaks: dict[FaultKind, _Streak] = {}
        self._slips, self._dead = ClockSlips(), DeadBearings()
        self._unwell = 0  # sweeps in a row before this one that show something
        self._unwell_since_ns = 0
        self.revision = 0  # of the memory: goes up when it changes

    @property
    def memory(self) -> Memory:
        """What the next process needs to go on."""
        return Memory(self._place, self._past, tuple(self._watch.usual), self.findings)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The faults that stand, the gravest first."""
        return tuple(self._findings[kind] for kind in FAULTS if kind in self._findings)

    def judge(self, look: Look, place: Place) -> Verdict:
        """Judge a sweep; ``place`` is the pose as it is stated: at another one the past begins anew."""
        if not look.fixed or place != self._place or not self._past.fits_plan(look):
            self._begin_past(look, place)
        past = self._past if look.fixed and self._past.is_enough else None
        found = self._suspicions(look, past)
        odd = any(FAULTS[each.kind].spoils for each in found) or (past is not None and self._watch.strange)
        if not self._unwell:
            self._unwell_since_ns = look.start_ns
        named = self._count(found, odd)
        before = self._unwell + 1 if any(FAULTS[kind].spoils for kind in named) else 0
        self._unwell = self._unwell + 1 if odd else 0
        if look.fixed:
            self._learn(look, odd or bool(found))
        spoiled_by = tuple(each.kind for each in self.findings if FAULTS[each.kind].spoils)
        return Verdict(self.findings, spoiled_by, before)

    def _suspicions(self, look: Look, past: Past | None) -> list[Suspicion]:
        """The gravest kind that the sweep shows, and those that may stand beside it."""
        beside = self._slips.suspicions(look, past)
        if past is not None:
            beside += self._dead.suspicions(look, past)
        placed = self._watch.suspicions(look, past) if past is not None else []
        main = (
            sensor_line.suspicions(look)
            or one_value.suspicions(look)
            or blocked.suspicions(look, past)
            or silence.suspicions(look, past)
            or ([] if beside else placed)
        )
        return main + beside

    def _count(self, found: list[Suspicion], odd: bool) -> list[FaultKind]:
        """Go on with the streaks and the standing faults; the kinds that are named now."""
        shown = {each.kind: each for each in found}
        kept = self._streaks if odd and not shown else {}  # a sweep that shows nothing clearly proves nothing
        self._streaks = kept | {kind: self._streaks.get(kind) or _Streak(self._unwell_since_ns) for kind in shown}
        named: list[FaultKind] = []
        for kind, each in shown.items():
            streak = self._streaks[kind]
            streak.count, streak.nats = streak.count + 1, streak.nats + each.evidence
            if kind not in self._findings and _is_enough(kind, streak):
                self.revision += 1
                self._findings[kind] = Finding(kind, streak.since_ns, _sure(kind, streak.nats), each.words)
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

    def _learn(self, look: Look, odd: bool) -> None:
        spoiled = any(FAULTS[kind].spoils for kind in self._findings)
        if not odd and not spoiled:
            if self._past.rows:
                self._watch.learn_from(look, self._past)
            self.revision += self._past.add(look)
        elif self._unwell >= _ODD_FOR_LONG and not self._findings:
            self._begin_past(look, self._place)

    def _begin_past(self, look: Look, place: Place) -> None:
        if look.fixed and self._past.rows:
            self._findings = {kind: one for kind, one in self._findings.items() if kind not in _OF_THE_PLACE}
        self._place, self._past = place, Past(look.bearing_rad if look.fixed else ())
        self._watch = PlaceWatch()
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


def _is_enough(kind: FaultKind, streak: _Streak) -> bool:
    return streak.count >= FAULTS[kind].named_after and streak.nats >= FAULTS[kind].least_nats


def _sure(kind: FaultKind, nats: float) -> float:
    return FAULTS[kind].most_sure * (1 - math.exp(-nats / _NATS_TO_BE_SURE))
