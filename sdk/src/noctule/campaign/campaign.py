"""An update campaign: which units get the image next, and when to halt. Knows no bus, no files and no clock.

The first group is small, so that an image that harms its units harms few. Each group is tried, then those of it that
failed are tried again; when more than a stated share of a group has failed after that, no further group is begun.
What has been done is only in the units: the same campaign begun again finds those that have the version.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum


class Outcome(StrEnum):
    """What became of one unit."""

    UPDATED = "updated"
    CURRENT = "up to date"
    FAILED = "failed"
    AWAY = "away"
    UNDER_WAY = "under way"
    NOT_TRIED = "not tried"


@dataclass(frozen=True)
class Rules:
    """``first`` units, then groups of ``group``; ``max_failed_share`` of a group (0 to 1) may fail without a halt.

    Those of a group that failed are tried again ``retries`` times. ``force`` updates units that have the version too.
    """

    first: int = 2
    group: int = 10
    max_failed_share: float = 0.2
    retries: int = 1
    force: bool = False


@dataclass(frozen=True)
class Candidate:
    """A unit before the campaign; ``away`` says why it can't be updated, empty if it can."""

    unit: str
    firmware: str
    away: str = ""


@dataclass(frozen=True)
class UnitResult:
    """What became of ``unit``, why, in which group (from 1; 0 for none) and after how many tries."""

    unit: str
    before: str
    outcome: Outcome
    reason: str = ""
    group: int = 0
    tries: int = 0

    @property
    def runs_the_image(self) -> bool:
        """The unit has the image's version, as far as its gateway has said."""
        return self.outcome in (Outcome.UPDATED, Outcome.CURRENT)


class Campaign:
    """The update of ``candidates`` to ``version``. Update what next_units() gives, note() each, and ask again."""

    def __init__(self, candidates: Iterable[Candidate], version: str, rules: Rules) -> None:
        self.version = version
        self.halted = ""  # why no further group is begun
        self._rules = rules
        self._results: dict[str, UnitResult] = {}
        self._waiting: list[str] = []
        self._group: list[str] = []
        self._number = 0
        for each in sorted(candidates, key=lambda candidate: candidate.unit):
            self._results[each.unit] = self._before(each)
            if self._results[each.unit].outcome is Outcome.NOT_TRIED:
                self._waiting.append(each.unit)

    def results(self) -> list[UnitResult]:
        """What is known of each unit, by name."""
        return list(self._results.values())

    def next_units(self) -> list[str]:
        """The units to update now, at the same time; none when the campaign is over or halted.

        They are those of the group that failed and may be tried again, else the next group.
        """
        if again := [each.unit for each in self._failed() if each.tries <= self._rules.retries]:
            return again
        if not self.halted:
            self.halted = self._why_halt()
        if self.halted:
            return []
        size = self._rules.group if self._number else self._rules.first
        self._group, self._waiting = self._waiting[:size], self._waiting[size:]
        self._number += bool(self._group)
        return list(self._group)

    def note(self, unit: str, error: str, detail: str = "") -> UnitResult:
        """One of next_units() is done: ``detail`` says how, or ``error`` says why it failed."""
        known = self._results[unit]
        outcome = Outcome.FAILED if error else Outcome.UPDATED
        self._results[unit] = UnitResult(
            unit, known.before, outcome, error or detail, self._number, tries=known.tries + 1
        )
        return self._results[unit]

    def leave(self, units: Iterable[str]) -> None:
        """The operator has stopped the campaign while ``units`` were being updated."""
        for unit in units:
            known = self._results[unit]
            reason = "its gateway goes on with the update"
            self._results[unit] = UnitResult(
                unit, known.before, Outcome.UNDER_WAY, reason, self._number, tries=known.tries + 1
            )

    def _before(self, candidate: Candidate) -> UnitResult:
        unit, firmware = candidate.unit, candidate.firmware
        if candidate.away:
            return UnitResult(unit, firmware, Outcome.AWAY, candidate.away)
        if firmware == self.version and not self._rules.force:
            return UnitResult(unit, firmware, Outcome.CURRENT)
        return UnitResult(unit, firmware, Outcome.NOT_TRIED)

    def _failed(self) -> list[UnitResult]:
        return [self._results[unit] for unit in self._group if self._results[unit].outcome is Outcome.FAILED]

    def _why_halt(self) -> str:
        failed = len(self._failed())
        if failed <= self._rules.max_failed_share * len(self._group):
            return ""
        return (
            f"{failed} of the {len(self._group)} units of group {self._number} failed, more than "
            f"{self._rules.max_failed_share:.0%}: see the reasons; the same command goes on from here"
        )
