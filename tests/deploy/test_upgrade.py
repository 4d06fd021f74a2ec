"""Programs of this version on data of the versions before, and on data of one to come: nothing is lost or harmed.

The data are real, in formats that are written here and not by programs out of the history: what lands may be made of
other commits than it was developed in.
"""

import sqlite3
from contextlib import closing
from pathlib import Path

from deploy.other_versions import make_log_earlier, make_store_earlier, of_a_later_version
from system.processes import Programs, programs, wait_until
from system.site import SITE, SURVEY_SWEEPS, PaperRoom, paper_room, wait_for_contour, wait_for_sweeps
from system.test_restart import logged_sweeps

from noctule.client import Client
from noctule.messages_pb2 import Contour, UnitStatus


def test_an_upgrade_keeps_log_store_and_map_and_a_later_versions_data_are_left_alone(tmp_path: Path) -> None:
    room = paper_room(tmp_path)
    log, store = tmp_path / "gateway/u1.sqlite", tmp_path / f"mapper/{SITE}.sqlite3"
    with programs(tmp_path) as running:
        running.start("simulator", *room.simulator(speed=24))
        start(room, running)
        before = wait_for_contour(room, running)
        log_id = logged_sweeps(room)[0].log_id
        end(running)

        make_log_earlier(log)
        make_store_earlier(store)
        start(room, running)
        upgraded = another_sweep(room, running, SURVEY_SWEEPS + 1)
        assert len(upgraded.walls) == len(before.walls) and len(upgraded.corners) == len(before.corners)
        converted = f"log {log} was converted from an earlier gateway's, with its {SURVEY_SWEEPS} sweeps"
        assert converted in running.log("gateway")
        end(running)

        with of_a_later_version(log), of_a_later_version(store):
            untouched = log.read_bytes(), store.read_bytes()
            start(room, running)
            refused = "has schema 4, this gateway knows 3; run its own version"
            wait_until(lambda: refused in running.log("gateway"), "the gateway does not refuse a later version's log")
            assert running.wait("mapper") == 1
            assert f"{store} has format 6, this mapper reads 5" in running.log("mapper")
            assert running.end("gateway") == 0
            assert (log.read_bytes(), store.read_bytes()) == untouched

        start(room, running)
        another_sweep(room, running, SURVEY_SWEEPS + 2)
        sweeps = logged_sweeps(room)
        end(running)
        running.end("simulator")

    count = SURVEY_SWEEPS + 2
    assert {sweep.log_id for sweep in sweeps} == {log_id}
    assert [sweep.log_sequence for sweep in sweeps] == list(range(1, count + 1))
    assert [sweep.sequence for sweep in sweeps] == list(range(count))
    with closing(sqlite3.connect(store)) as database:
        held = database.execute("SELECT log_id, log_sequence FROM sweep ORDER BY log_sequence").fetchall()
    assert held == [(log_id, number) for number in range(1, count + 1)]
    assert not (log.parent / "set-aside").exists() and not (store.parent / "set-aside").exists()


def start(room: PaperRoom, running: Programs) -> None:
    running.start("gateway", *room.gateway())
    running.start("mapper", *room.mapper())


def end(running: Programs) -> None:
    for name in ("mapper", "gateway"):
        assert running.end(name) == 0, running.log(name)


def another_sweep(room: PaperRoom, running: Programs, count: int) -> Contour:
    """Order a sweep, and return the first map that rests on ``count`` sweeps."""
    wait_for_sweeps(room, running, count - 1)
    with Client(SITE, connect=[room.connect]) as client:
        wait_for_the_unit(client)
    running.start("rpc", "noctule", "rpc", SITE, "u1", "single", "--connect", room.connect)
    assert running.wait("rpc") == 0, running.log("rpc")

    def mapped() -> Contour | None:
        running.check()
        contour = client.contour()
        return contour if contour is not None and contour.sweeps >= count else None

    with Client(SITE, connect=[room.connect]) as client:
        return wait_until(mapped, f"no map rests on {count} sweeps")


def wait_for_the_unit(client: Client) -> None:
    """Until its gateway is on the bus and has its line: before that a command is refused."""

    def is_connected() -> bool:
        return any(status.state != UnitStatus.STATE_DISCONNECTED for status in client.unit_statuses())

    wait_until(is_connected, "no unit is connected")
