"""The examples as a user runs them, beside a real gateway and mapper."""

import re
from pathlib import Path

import duckdb
from system.processes import ROOT, Programs, programs, wait_until
from system.site import SITE, SURVEY_SWEEPS, PaperRoom, paper_room, wait_for_contour, wait_for_sweeps

from noctule import Client
from noctule.messages_pb2 import Contour

WALLS = 4  # of the paper's room


def run_example(running: Programs, name: str, script: str, *arguments: str) -> None:
    running.start(name, "python", str(ROOT / "sdk/examples" / script), *arguments)


def readme_query() -> str:
    """The query that sdk/README.md shows."""
    (query,) = re.findall(r"```sql\n(.*?)```", (ROOT / "sdk/README.md").read_text(), re.DOTALL)
    return query


def test_walls_raise_alarms_and_sweeps_and_contours_are_in_duckdb_once_each_though_it_was_killed(
    tmp_path: Path,
) -> None:
    room = paper_room(tmp_path)
    file = tmp_path / "site.duckdb"
    with programs(tmp_path) as running:
        running.start("gateway", *room.gateway())
        running.start("mapper", *room.mapper())
        run_example(running, "alarm", "contour_alarm.py", SITE, room.connect)
        run_example(running, "store", "to_duckdb.py", SITE, str(file), room.connect)
        running.start("simulator", *room.simulator(speed=16))
        for head in (10, 25):
            wait_for_sweeps(room, running, head)
            running.kill("store")
            run_example(running, "store", "to_duckdb.py", SITE, str(file), room.connect)
        last = wait_for_contour(room, running)
        with Client(SITE, connect=[room.connect]) as client:
            logged = list(client.history("u1"))
        wait_until(lambda: running.log("alarm").count("has come") >= WALLS, "too few alarms")
        # DuckDB locks its file, so the rows can be counted only when the example has ended.
        running.kill("store")
        run_example(running, "store", "to_duckdb.py", SITE, str(file), room.connect)
        stored = wait_until(lambda: stored_when_killed(running, room, file, last), "not all stored")

    sweeps, contours, found = stored
    assert sweeps == [(sweep.unit, sweep.log_id, sweep.log_sequence, len(sweep.readings)) for sweep in logged]
    assert len(sweeps) == SURVEY_SWEEPS
    assert len(contours) == len(set(contours))
    assert last.SerializeToString() in [message for _, _, message in contours]
    assert [(unit, swept) for unit, swept, *_ in found] == [("u1", SURVEY_SWEEPS)]


def stored_when_killed(running: Programs, room: PaperRoom, file: Path, last: Contour):
    """Kill the example, read its file, and start it again if it has not come to the end yet."""
    running.kill("store")
    with duckdb.connect(str(file)) as database:
        sweeps = database.execute(
            "SELECT unit, log_id, log_sequence, count(r.bearing_rad) FROM sweep LEFT JOIN reading r "
            "USING (unit, log_id, log_sequence) GROUP BY ALL ORDER BY log_sequence"
        ).fetchall()
        contours = database.execute("SELECT mapper, version, message FROM contour ORDER BY version").fetchall()
        found = database.execute(readme_query()).fetchall()
    if len(sweeps) >= SURVEY_SWEEPS and contours and contours[-1][1] >= last.version:
        return sweeps, contours, found
    run_example(running, "store", "to_duckdb.py", SITE, str(file), room.connect)
    wait_for_sweeps(room, running, SURVEY_SWEEPS)
    return None
