"""Plays a history on a deployment, waits until all is well again, and has the checker look."""

import sqlite3
import time
from dataclasses import dataclass

from system.histories.checker import findings, removed_unread
from system.histories.deployment import Deployment
from system.histories.faults import UNITS, History, at, moments_s

SETTLED_WITHIN_S = (
    60.0  # a session's lease (10 s), a follower's and a line's longest back-off (10 s, 5 s), a start (5 s)
)
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
    """Wait until every unit has handed over a sweep made from now on, and all is in the store; if not, say what is."""
    before = {unit: set(witness.made) for unit, witness in deployed.witnesses().items()}
    deadline_s = time.monotonic() + SETTLED_WITHIN_S
    found = ["not looked at yet"]
    while found and time.monotonic() < deadline_s:
        time.sleep(_LOOK_EVERY_S)
        deployed.look_after()
        found = look(deployed, before)
    ended, deployed.ended = deployed.ended, []
    handed_over, removed = counts(deployed)
    return Outcome(found, ended, handed_over, removed, time.monotonic() - began_s)


def look(deployed: Deployment, before: dict[str, set[tuple[int, int]]]) -> list[str]:
    """What is not yet, or not at all, as it should be."""
    witnesses = deployed.witnesses()  # first: what comes later may not be in the store yet
    silent = [unit for unit in UNITS if not witnesses[unit].handed_over - before[unit]]
    if silent:
        return [f"{', '.join(silent)}: nothing new was handed over since the faults were over"]
    try:
        held = deployed.held()
        extents = {unit: deployed.extent(unit) for unit in UNITS}
    except sqlite3.Error as error:
        return [f"a store or a log can't be read: {error}"]
    made = deployed.witnesses()  # and last: what is held may have been made since
    for unit in UNITS:
        made[unit].handed_over.intersection_update(witnesses[unit].handed_over)
    return [each for unit in UNITS for each in findings(unit, made[unit], held.get(unit, []), extents[unit])]


def counts(deployed: Deployment) -> tuple[int, int]:
    """How many sweeps were handed over so far, and how many of them retention removed before they were read."""
    handed_over = sum(len(witness.handed_over) for witness in deployed.witnesses().values())
    try:
        held = deployed.held()
        return handed_over, sum(removed_unread(held.get(unit, []), deployed.extent(unit)) for unit in UNITS)
    except sqlite3.Error:
        return handed_over, 0
