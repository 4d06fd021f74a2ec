"""Plays a history on a deployment, waits until all is well again, and has the checker look."""

import sqlite3
import time
from dataclasses import dataclass, replace

from system.histories.cable import Sequences
from system.histories.checker import findings, removed_unread
from system.histories.deployment import Deployment
from system.histories.faults import UNITS, History, at, moments_s

# On a quiet machine it takes at most a session's lease (10 s), a follower's and a line's longest back-off (10 s, 5 s)
# and a start (5 s); these looks take 5 minutes there. Counted in looks and not in seconds, because on a starved machine
# the process that looks is starved too.
SETTLED_WITHIN_LOOKS = 1000
_LOOK_EVERY_S = 0.25


@dataclass(frozen=True)
class Outcome:
    """What the checker found, and how much there was to find."""

    findings: list[str]
    ended: list[str]  # programs that ended by themselves and were started again, which is no finding in itself
    handed_over: int
    removed: int
    took_s: float


def play(deployed: Deployment, history: History) -> Outcome:
    """Bring the history about, and what is left of it when all faults are over."""
    began_s = time.monotonic()
    for moment_s in moments_s(history):
        while (left_s := began_s + moment_s - time.monotonic()) > 0:
            time.sleep(min(left_s, _LOOK_EVERY_S))
            deployed.look_after()
        deployed.bring_about(at(history, moment_s))
    return settle(deployed, began_s)


def settle(deployed: Deployment, began_s: float) -> Outcome:
    """Wait until every unit has handed over a sweep made from now on, and then until all handed over by then is in the
    store; if it is not, say what is missing.
    """
    before = {unit: set(witness.made) for unit, witness in deployed.witnesses().items()}
    owed: dict[str, set[Sequences]] = {}
    found = ["not looked at yet"]
    for _ in range(SETTLED_WITHIN_LOOKS):
        time.sleep(_LOOK_EVERY_S)
        deployed.look_after()
        handed_over = {unit: witness.handed_over for unit, witness in deployed.witnesses().items()}
        if not owed and all(handed_over[unit] - before[unit] for unit in UNITS):
            owed = handed_over
        found = look(deployed, owed) if owed else [_silent(handed_over, before)]
        if not found:
            break
    ended, deployed.ended = deployed.ended, []
    handed_over, removed = counts(deployed)
    return Outcome(found, ended, handed_over, removed, time.monotonic() - began_s)


def look(deployed: Deployment, owed: dict[str, set[Sequences]]) -> list[str]:
    """What the checker finds where the sweeps ``owed`` must be in the store."""
    try:
        held = deployed.held()
        extents = {unit: deployed.extent(unit) for unit in UNITS}
    except sqlite3.Error as error:
        return [f"a store or a log can't be read: {error}"]
    witnesses = deployed.witnesses()  # last: what is held may have been made since ``owed`` was noted
    return [
        each
        for unit in UNITS
        for each in findings(unit, replace(witnesses[unit], handed_over=owed[unit]), held.get(unit, []), extents[unit])
    ]


def _silent(handed_over: dict[str, set[Sequences]], before: dict[str, set[Sequences]]) -> str:
    silent = [unit for unit in UNITS if not handed_over[unit] - before[unit]]
    return f"{', '.join(silent)}: nothing new was handed over since the faults were over"


def counts(deployed: Deployment) -> tuple[int, int]:
    """How many sweeps were handed over so far, and how many of them retention removed before they were read."""
    handed_over = sum(len(witness.handed_over) for witness in deployed.witnesses().values())
    try:
        held = deployed.held()
        return handed_over, sum(removed_unread(held.get(unit, []), deployed.extent(unit)) for unit in UNITS)
    except sqlite3.Error:
        return handed_over, 0
