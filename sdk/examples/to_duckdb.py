"""Keeps a site's sweeps and contours in DuckDB, each once, also after a kill: to_duckdb.py SITE FILE [ROUTER ...]"""

import sys
import threading
from collections.abc import Sequence

import duckdb

import noctule
from noctule import threads
from noctule.messages_pb2 import Contour, Cursor, Sweep

TABLES = """
CREATE TABLE IF NOT EXISTS sweep (unit TEXT, log_id TEXT, log_sequence UBIGINT, start_time TIMESTAMP_NS,
    x_m DOUBLE, y_m DOUBLE, heading_rad DOUBLE, PRIMARY KEY (unit, log_id, log_sequence));
CREATE TABLE IF NOT EXISTS reading (unit TEXT, log_id TEXT, log_sequence UBIGINT, bearing_rad DOUBLE,
    time_offset_s DOUBLE, time_of_flight_s DOUBLE);  -- NULL where there was no echo
CREATE TABLE IF NOT EXISTS cursor (unit TEXT PRIMARY KEY, log_id TEXT, log_sequence UBIGINT);
CREATE TABLE IF NOT EXISTS contour (mapper TEXT, version UBIGINT, time TIMESTAMP_NS, sweeps UBIGINT, message BLOB,
    PRIMARY KEY (mapper, version));
CREATE TABLE IF NOT EXISTS wall (mapper TEXT, version UBIGINT, theta_rad DOUBLE, rho_m DOUBLE,
    x1_m DOUBLE, y1_m DOUBLE, x2_m DOUBLE, y2_m DOUBLE);
"""


class Database:
    """The file. Each method is one transaction, and may be called from any thread."""

    def __init__(self, path: str) -> None:
        self._connection = duckdb.connect(path)
        self._connection.execute(TABLES)
        self._lock = threading.Lock()

    def cursors(self) -> dict[str, Cursor]:
        """How far each unit's log is stored."""
        rows = self._connection.execute("SELECT unit, log_id, log_sequence FROM cursor").fetchall()
        return {unit: Cursor(unit=unit, log_id=log_id, log_sequence=sequence) for unit, log_id, sequence in rows}

    def store_sweeps(self, sweeps: Sequence[Sweep]) -> None:
        """Some sweeps of one unit, and with them the cursor: both are stored, or neither."""
        last = sweeps[-1]
        self._store(
            ("INSERT INTO sweep VALUES (?, ?, ?, make_timestamp_ns(?), ?, ?, ?)", [_sweep_row(s) for s in sweeps]),
            ("INSERT INTO reading VALUES (?, ?, ?, ?, ?, ?)", [row for s in sweeps for row in _reading_rows(s)]),
            ("INSERT OR REPLACE INTO cursor VALUES (?, ?, ?)", [(last.unit, last.log_id, last.log_sequence)]),
        )

    def store_contour(self, contour: Contour) -> None:
        """A contour, unless it is there already: the present one comes again after each start."""
        identity = (contour.mapper, contour.version)
        found = "SELECT count(*) FROM contour WHERE mapper = ? AND version = ?"
        if self._connection.cursor().execute(found, identity).fetchone() == (0,):
            row = (*identity, contour.time.ToNanoseconds(), contour.sweeps, contour.SerializeToString())
            walls = [
                (*identity, wall.theta_rad, wall.rho_m, wall.start.x_m, wall.start.y_m, wall.end.x_m, wall.end.y_m)
                for wall in contour.walls
            ]
            self._store(
                ("INSERT INTO contour VALUES (?, ?, make_timestamp_ns(?), ?, ?)", [row]),
                ("INSERT INTO wall VALUES (?, ?, ?, ?, ?, ?, ?, ?)", walls),
            )

    def _store(self, *statements: tuple[str, list[tuple]]) -> None:
        with self._lock:
            self._connection.begin()
            try:
                for statement, rows in statements:
                    if rows:
                        self._connection.executemany(statement, rows)
                self._connection.commit()
            except BaseException:
                self._connection.rollback()
                raise


def _sweep_row(sweep: Sweep) -> tuple:
    pose = (sweep.pose.x_m, sweep.pose.y_m, sweep.pose.heading_rad) if sweep.HasField("pose") else (None,) * 3
    return sweep.unit, sweep.log_id, sweep.log_sequence, sweep.start.ToNanoseconds(), *pose


def _reading_rows(sweep: Sweep) -> list[tuple]:
    identity = (sweep.unit, sweep.log_id, sweep.log_sequence)
    return [
        (
            *identity,
            each.bearing_rad,
            each.time_offset_s,
            each.time_of_flight_s if each.HasField("time_of_flight_s") else None,
        )
        for each in sweep.readings
    ]


def main(site: str, path: str, routers: list[str]) -> None:
    """Store what comes, until the program is ended."""
    database = Database(path)
    with (
        noctule.Client(site, connect=routers) as client,
        noctule.LogFollower(client, database.store_sweeps, database.cursors()),
    ):
        client.on_contour(database.store_contour)
        threading.Event().wait()


if __name__ == "__main__":
    threads.end_process_when_one_fails()
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
