"""Sweeps that a map does not rest on: how many, where they stand and why, in a line for each reason."""

from collections.abc import Iterable
from dataclasses import dataclass

from noctule.errors import NoctuleError
from noctule.survey import Record
from noctule_mapper.config import Window
from noctule_mapper.readings.sweep import SweepError
from noctule_mapper.window import Reason

_MOST_NAMED = 8  # runs of neighbouring lines


@dataclass(frozen=True)
class LeftOut:
    """Sweeps at ``lines`` of the survey ``source``, which rise, left out for one reason; in MCAP a sweep is a line."""

    source: str
    lines: tuple[int, ...]
    reason: str

    def __str__(self) -> str:
        runs = _runs(self.lines)
        more = f" and {len(runs) - _MOST_NAMED} more" if len(runs) > _MOST_NAMED else ""
        count = f"{len(self.lines)} sweep{'' if len(self.lines) == 1 else 's'}"
        return f"left out {count} ({self.source}: {', '.join(runs[:_MOST_NAMED])}{more}): {self.reason}"


def _runs(lines: tuple[int, ...]) -> list[str]:
    """Neighbouring numbers as "3-7"."""
    starts = [n for n, line in enumerate(lines) if n == 0 or line != lines[n - 1] + 1]
    ends = [*(start - 1 for start in starts[1:]), len(lines) - 1]
    pairs = [(lines[start], lines[end]) for start, end in zip(starts, ends, strict=True)]
    return [str(first) if first == last else f"{first}-{last}" for first, last in pairs]


def because_of_errors(failed: Iterable[tuple[Record, NoctuleError]]) -> list[LeftOut]:
    """Those that can't be read or mapped, by unit and kind of error; the first error of each kind is named."""
    found: dict[tuple[str, str, str], tuple[str, list[int]]] = {}
    for record, error in failed:
        unit = "" if isinstance(record.sweep, NoctuleError) else record.sweep.unit
        kind = error.kind if isinstance(error, SweepError) else "unreadable"
        found.setdefault((record.source, unit, kind), (str(error), []))[1].append(record.number)
    return [LeftOut(source, tuple(lines), reason) for (source, _, _), (reason, lines) in found.items()]


def because_of_window(outside: Iterable[tuple[Record, Reason]], window: Window) -> list[LeftOut]:
    """Those that are not in the window, by reason."""
    told = {
        "repeated": "there is one of the same log_id and log_sequence before",
        "superseded": (
            f"later ones from the same place stand for them ([window] sweeps_per_place = {window.sweeps_per_place})"
        ),
        "too old": f"older than [window] max_age_s = {window.max_age_s:g} before the newest of the same clock epoch",
        "too many": f"more than [window] max_sweeps = {window.max_sweeps}",
    }
    found: dict[tuple[str, Reason], list[int]] = {}
    for record, reason in outside:
        found.setdefault((record.source, reason), []).append(record.number)
    return [LeftOut(source, tuple(lines), told[reason]) for (source, reason), lines in found.items()]
