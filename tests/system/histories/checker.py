"""The checker: every sweep that a unit has handed over is once in the mapper's store, as the unit made it, or counted.

It knows four things of a unit: what the unit has made and handed over (the witness at its end of the line), what the
mapper holds, and how far its log at the gateway goes.
"""

import sqlite3
from collections import Counter
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from math import pi
from pathlib import Path

from system.histories.cable import Witness

from noctule.messages_pb2 import READING_STATUS_ECHO, Reading, Sweep
from noctule_gateway.wire import frames

TICK_S = 0.25e-6  # firmware/README.md, "Frames"
BEARING_RAD = 2 * pi / 65536
_NAMED = 5  # sweeps in a finding


@dataclass(frozen=True)
class LogExtent:
    """How far a unit's log goes: the newest log_sequence, and the oldest that retention has left."""

    log_id: str
    head: int
    tail: int


def findings(unit: str, witness: Witness, held: Sequence[Sweep], log: LogExtent) -> list[str]:
    """What is wrong with ``held``, the unit's sweeps in the mapper's store; nothing if all is well."""
    wrong = []
    counts = Counter((sweep.boot, sweep.sequence) for sweep in held)
    if doubled := [name for name, count in counts.items() if count > 1]:
        wrong.append(f"{unit}: held more than once: {_named(doubled)}")
    if unknown := [name for name in counts if name not in witness.made]:
        wrong.append(f"{unit}: held, and never made: {_named(unknown)}")
    altered = [
        (sweep.boot, sweep.sequence)
        for sweep in held
        if (made := witness.made.get((sweep.boot, sweep.sequence))) and not same(made, sweep)
    ]
    if altered:
        wrong.append(f"{unit}: held, and altered: {_named(altered)}")
    missing = [name for name in witness.handed_over if name not in counts]
    removed = removed_unread(held, log)
    if len(missing) > removed:
        wrong.append(
            f"{unit}: {len(missing)} handed over and not held, {removed} of them removed by retention "
            f"(log {log.log_id}, {log.tail} to {log.head}): {_named(missing)}"
        )
    return wrong


def removed_unread(held: Sequence[Sweep], log: LogExtent) -> int:
    """How many sweeps retention has removed from the log that are not held."""
    read = {sweep.log_sequence for sweep in held if sweep.log_id == log.log_id}
    return sum(sequence not in read for sequence in range(1, log.tail))


def same(made: frames.Sweep, held: Sweep) -> bool:
    """The sweep that is held is the one that was made: waypoint, bearings, and echoes to the tick."""
    waypoint = held.waypoint if held.HasField("waypoint") else frames.NO_WAYPOINT
    return (
        made.waypoint == waypoint
        and len(made.readings) == len(held.readings)
        and all(_same(one, other, held.clock_drift) for one, other in zip(made.readings, held.readings, strict=True))
    )


def _same(made: frames.Reading, held: Reading, clock_drift: float) -> bool:
    turned = round(held.bearing_rad / BEARING_RAD) - made.bearing
    if turned % 65536:
        return False
    if made.echo >= frames.FIRST_NO_ECHO:
        return held.status != READING_STATUS_ECHO and not held.HasField("time_of_flight_s")
    ticks = held.time_of_flight_s * (1 + clock_drift) / TICK_S
    return held.status == READING_STATUS_ECHO and round(ticks) == made.echo


def held_sweeps(store: Path) -> dict[str, list[Sweep]]:
    """The sweeps in a mapper's store, by unit, those that are set aside too. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{store.absolute().as_uri()}?mode=ro", uri=True)) as database:
        records = database.execute("SELECT record FROM sweep UNION ALL SELECT record FROM set_aside").fetchall()
    held: dict[str, list[Sweep]] = {}
    for (record,) in records:
        sweep = Sweep.FromString(record)
        held.setdefault(sweep.unit, []).append(sweep)
    return held


def log_extent(log: Path) -> LogExtent:
    """How far a unit's log goes, from the gateway's file. Raises sqlite3.Error."""
    with closing(sqlite3.connect(f"{log.absolute().as_uri()}?mode=ro", uri=True)) as database:
        return LogExtent(*database.execute("SELECT log_id, head, tail FROM log").fetchone())


def _named(sweeps: Sequence[tuple[int, int]]) -> str:
    names = [f"boot {boot} sequence {sequence}" for boot, sequence in sorted(sweeps)]
    return ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
