"""The window: which sweeps the map rests on, of a log that goes on for ever and of a file alike.

What is too old, superseded at its place or too many leaves it. It stands in a table of SQLite, since a live mapper
keeps it over a restart; for a file it stands in memory.
"""

import sqlite3
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby, islice
from math import tau
from typing import Any, Literal

from noctule.checksum import checksum
from noctule.messages_pb2 import Sweep
from noctule_mapper.config import Window
from noctule_mapper.readings.faulty import Suspect
from noctule_mapper.readings.sweep import identity_of

Identity = tuple[str, int]
"""As from identity_of(); a log_id is drawn at random, so it names its unit too."""

Reason = Literal["repeated", "superseded", "too old", "too many"]

SCHEMA = (
    """CREATE TABLE IF NOT EXISTS sweep (
        unit TEXT NOT NULL, log_id TEXT NOT NULL, log_sequence INTEGER NOT NULL,
        clock_epoch TEXT NOT NULL, start_ns INTEGER NOT NULL, entered_elapsed_s REAL NOT NULL, visit INTEGER NOT NULL,
        place_x_m REAL NOT NULL, place_y_m REAL NOT NULL, place_heading_rad REAL NOT NULL,
        record BLOB NOT NULL, checksum BLOB NOT NULL,
        PRIMARY KEY (unit, log_id, log_sequence))""",
    "CREATE INDEX IF NOT EXISTS sweep_by_time ON sweep (clock_epoch, start_ns)",
    "CREATE INDEX IF NOT EXISTS sweep_by_entry ON sweep (entered_elapsed_s)",
    "CREATE INDEX IF NOT EXISTS sweep_by_place ON sweep (unit, place_x_m, place_y_m, place_heading_rad)",
)
_COVERED = (
    "unit",
    "log_id",
    "log_sequence",
    "clock_epoch",
    "start_ns",
    "elapsed_s",
    "visit",
    "x_m",
    "y_m",
    "heading_rad",
    "record",
)
_CLOCKS_DIFFER_NS = 300 * 10**9  # a sweep may be stamped this much ahead of the host that reads it

# A sweep is at least as old as the time that has passed since it entered. A log may have kept it for long before that,
# which the times tell that one clock has told between two settings: of one epoch. The newest of these counts, but for
# times that the host's clock has not come to: one wrong time must not empty the window. Times without an epoch, as
# earlier gateways tell them, are not compared.
# The first part steps from epoch to epoch over the index: a GROUP BY would read all sweeps at each commit.
_TOO_OLD = """
WITH RECURSIVE epoch (name) AS (
    SELECT min(clock_epoch) FROM sweep WHERE clock_epoch > ''
    UNION ALL SELECT (SELECT min(clock_epoch) FROM sweep WHERE clock_epoch > name) FROM epoch WHERE name IS NOT NULL),
newest (name, start_ns) AS (
    SELECT name, (SELECT max(start_ns) FROM sweep WHERE clock_epoch = name AND start_ns <= :now_ns) FROM epoch)
DELETE FROM sweep WHERE rowid IN (
    SELECT rowid FROM sweep WHERE entered_elapsed_s < :elapsed_s - :max_age_s
    UNION ALL
    SELECT sweep.rowid FROM newest CROSS JOIN sweep ON sweep.clock_epoch = newest.name
    AND sweep.start_ns > 0 AND sweep.start_ns < newest.start_ns - :max_age_ns)
RETURNING log_id, log_sequence
"""

# A visit is a stay of one unit at one place, named after the log_sequence of its first sweep, whose pose is the place:
# places so keep their distance from one another, and noise in the poses makes no new ones.
_NEAR = """
unit = :unit AND place_x_m BETWEEN :x_m - :radius_m AND :x_m + :radius_m
AND (place_x_m - :x_m) * (place_x_m - :x_m) + (place_y_m - :y_m) * (place_y_m - :y_m) <= :radius_m * :radius_m
AND min(abs(place_heading_rad - :heading_rad), :full_turn_rad - abs(place_heading_rad - :heading_rad)) <= :turn_rad
"""
_VISIT_BEFORE = f"""
SELECT visit, place_x_m, place_y_m, place_heading_rad FROM (
    SELECT * FROM sweep WHERE unit = :unit AND log_id = :log_id AND log_sequence < :log_sequence
    ORDER BY log_sequence DESC LIMIT 1)
WHERE {_NEAR}
"""
_ENTER = """
INSERT OR IGNORE INTO sweep VALUES (
    :unit, :log_id, :log_sequence, :clock_epoch, :start_ns, :elapsed_s, :visit, :x_m, :y_m, :heading_rad, :record,
    :checksum)
"""
# Of a place, the newest sweeps of its newest visit stay. What came in another log is older.
_SUPERSEDED = f"""
WITH here AS (SELECT rowid AS id, log_id, log_sequence, visit FROM sweep WHERE {_NEAR}),
own AS (SELECT * FROM here WHERE log_id = :log_id)
DELETE FROM sweep WHERE rowid IN (SELECT id FROM here) AND rowid NOT IN (
    SELECT id FROM own WHERE visit = (SELECT max(visit) FROM own)
    ORDER BY log_sequence DESC LIMIT :sweeps_per_place)
RETURNING log_id, log_sequence
"""
_SUSPECT = """
DELETE FROM sweep WHERE log_id = :log_id AND log_sequence BETWEEN :first AND :last RETURNING log_id, log_sequence
"""
_TOO_MANY = """
DELETE FROM sweep WHERE rowid IN (
    SELECT rowid FROM sweep ORDER BY rowid DESC LIMIT -1 OFFSET :max_sweeps)
RETURNING log_id, log_sequence
"""


class SweepWindow:
    """The window in a database that is its caller's, who begins and ends the transactions."""

    def __init__(self, database: sqlite3.Connection, window: Window) -> None:
        self._database, self._window = database, window
        for statement in SCHEMA:
            database.execute(statement)
        self._held: int | None = None  # so many sweeps; None where they are to be counted

    def recount(self) -> None:
        """Count the sweeps again when their number matters: after a transaction that failed, or others' changes."""
        self._held = None

    def enter(self, sweep: Sweep, record: bytes, elapsed_s: float) -> list[Identity] | None:
        """Take a sweep in, with what is to be kept of it; those that it supersedes, perhaps itself. None if it is there
        already. ``elapsed_s`` as for too_old().
        """
        row = self._row(sweep) | {"record": record, "elapsed_s": elapsed_s}
        row["checksum"] = checksum(*(row[name] for name in _COVERED))
        if self._database.execute(_ENTER, row).rowcount != 1:
            return None
        if self._held is not None:
            self._held += 1
        return self._taken_out(_SUPERSEDED, row)

    def take_out(self, suspect: Suspect) -> list[Identity]:
        """Take out the sweeps that have turned out to be suspect."""
        return self._taken_out(_SUSPECT, {"log_id": suspect.log_id, "first": suspect.first, "last": suspect.last})

    def too_old(self, elapsed_s: float, now_ns: int) -> list[Identity]:
        """Take out what is too old. ``elapsed_s`` counts the time that passes, as Elapsed does; ``now_ns`` is what the
        host's clock shows, which may be wrong.
        """
        age = {"max_age_s": self._window.max_age_s, "max_age_ns": int(self._window.max_age_s * 1e9)}
        now = {"elapsed_s": elapsed_s, "now_ns": now_ns + _CLOCKS_DIFFER_NS}
        return self._taken_out(_TOO_OLD, age | now)

    def too_many(self) -> list[Identity]:
        """Take out what is too many."""
        if self._count() <= self._window.max_sweeps:  # the statement would go over the whole window to find that out
            return []
        return self._taken_out(_TOO_MANY, {"max_sweeps": self._window.max_sweeps})

    def _count(self) -> int:
        if self._held is None:
            (count,) = self._database.execute("SELECT count(*) FROM sweep").fetchone()
            self._held = int(count)
        return self._held

    def _taken_out(self, statement: str, values: dict[str, Any]) -> list[Identity]:
        taken = self._database.execute(statement, values).fetchall()
        if self._held is not None:
            self._held -= len(taken)
        return taken

    def _row(self, sweep: Sweep) -> dict[str, Any]:
        """A sweep's row: it belongs to the visit of the sweep before it in its log, or begins a visit where it is."""
        log_id, log_sequence = identity_of(sweep)
        row = {
            "unit": sweep.unit,
            "log_id": log_id,
            "log_sequence": log_sequence,
            "clock_epoch": sweep.clock_epoch,
            "start_ns": sweep.start.ToNanoseconds(),
            "visit": log_sequence,
            "x_m": sweep.pose.x_m + 0.0,  # SQLite keeps no -0.0, and the row's checksum covers what it keeps
            "y_m": sweep.pose.y_m + 0.0,
            "heading_rad": sweep.pose.heading_rad % tau + 0.0,
            "radius_m": self._window.place_radius_m,
            "turn_rad": self._window.place_heading_rad,
            "full_turn_rad": tau,
            "sweeps_per_place": self._window.sweeps_per_place,
        }
        before = self._database.execute(_VISIT_BEFORE, row).fetchone()
        return row | dict(zip(("visit", "x_m", "y_m", "heading_rad"), before or (), strict=False))


def lasting(sweeps: Iterable[Sweep], is_usable: Callable[[Sweep], bool], sweeps_per_place: int) -> list[Sweep]:
    """Of one log's sweeps in order, those that a window is not the same without when all have entered it.

    Of a run of sweeps from one pose these are the newest ``sweeps_per_place`` usable ones and, since the visit bears
    its number, the first usable one. Those between them are superseded by the end of the run. ``is_usable``, which may
    cost, is asked of few of them.
    """
    found: list[Sweep] = []
    for _, run in groupby(sweeps, key=_stand):
        stay = list(run)
        newest = list(islice(filter(is_usable, reversed(stay)), sweeps_per_place))[::-1]
        first = next(filter(is_usable, stay), None) if len(newest) == sweeps_per_place else None
        found += newest if first is None or first is newest[0] else [first, *newest]
    return found


def _stand(sweep: Sweep) -> tuple[object, ...]:
    pose = sweep.pose
    return sweep.unit, identity_of(sweep)[0], sweep.HasField("pose"), pose.x_m, pose.y_m, pose.heading_rad


@dataclass(frozen=True)
class Windowed:
    """Numbers of the sweeps that a window holds, and of those that it does not, with the reason; in their order."""

    held: list[int]
    left: dict[int, Reason]


def windowed(sweeps: Sequence[Sweep], window: Window, now_ns: int) -> Windowed:
    """Which of ``sweeps``, in the order in which they were made, are in the window after the last of them, at
    ``now_ns`` of the host's clock. How long ago a file's sweeps were made it does not say, so that they have ages by
    their own times alone.
    """
    database = sqlite3.connect(":memory:", isolation_level=None)
    try:
        rows, numbers, left = SweepWindow(database, window), dict[Identity, int](), dict[int, Reason]()
        for number, sweep in enumerate(sweeps):
            if identity_of(sweep) in numbers:
                left[number] = "repeated"
                continue
            numbers[identity_of(sweep)] = number
            superseded = rows.enter(sweep, b"", elapsed_s=0.0) or []
            left.update((numbers[one], "superseded") for one in superseded)
        left.update((numbers[one], "too old") for one in rows.too_old(0.0, now_ns))
        left.update((numbers[one], "too many") for one in rows.too_many())
    finally:
        database.close()
    return Windowed([number for number in range(len(sweeps)) if number not in left], dict(sorted(left.items())))
