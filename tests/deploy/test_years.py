"""docs/pages/years.md rehearsed with the installed commands: backup, upgrade, the way back, restore, another unit."""

import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest
from deploy.other_versions import make_log_earlier, make_store_earlier
from deploy.test_upgrade import another_sweep, end, start
from system.processes import ROOT, Programs, free_port_range, free_ports, programs, wait_until
from system.site import SITE, SURVEY_SWEEPS, PaperRoom, paper_room, wait_for_contour, wait_for_sweeps
from system.test_restart import logged_sweeps

from noctule.client import Client
from noctule.messages_pb2 import Contour, Sweep


def ran(*command: str | Path) -> str:
    """What a command prints; fails where the command does."""
    ended = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return ended.stdout


def restore(copy: Path, data: Path) -> None:
    """As years.md says: move the folder away, put the copy in its place."""
    if data.exists():
        data.rename(data.with_name(f"{data.name}.away"))
    shutil.copytree(copy, data)


def schema(path: Path) -> int:
    """The version of a database's format."""
    with closing(sqlite3.connect(path)) as database:
        return database.execute("PRAGMA user_version").fetchone()[0]


def test_a_backup_before_an_upgrade_is_the_way_back_and_the_map_goes_on_after_it(tmp_path: Path) -> None:
    room = paper_room(tmp_path)
    gateway, mapper = tmp_path / "gateway", tmp_path / "mapper"
    log, store = gateway / "u1.sqlite", mapper / f"{SITE}.sqlite3"
    with programs(tmp_path) as running:
        running.start("simulator", *room.simulator(speed=24))
        start(room, running)
        before = wait_for_contour(room, running)
        first = logged_sweeps(room)
        end(running)
        make_log_earlier(log)
        make_store_earlier(store)
        earlier = schema(log), schema(store)

        ran("noctule-gateway", "backup", gateway, tmp_path / "gateway-copy")
        ran("noctule-mapper", "backup", mapper, tmp_path / "mapper-copy")
        start(room, running)
        another_sweep(room, running, SURVEY_SWEEPS + 1)
        end(running)
        assert (schema(log), schema(store)) > earlier  # which programs of the version before refuse

        restore(tmp_path / "gateway-copy", gateway)
        restore(tmp_path / "mapper-copy", mapper)
        assert (schema(log), schema(store)) == earlier  # which they read
        start(room, running)
        after = another_sweep(room, running, SURVEY_SWEEPS + 1)
        restored = logged_sweeps(room)
        end(running)
        running.end("simulator")

    assert len(after.walls) == len(before.walls) and len(after.corners) == len(before.corners)
    assert [facts(sweep) for sweep in restored[:-1]] == [facts(sweep) for sweep in first]
    assert restored[0].log_id != first[0].log_id  # sequence 45 of that one is taken
    with closing(sqlite3.connect(store)) as database:
        assert database.execute("SELECT count(*) FROM sweep").fetchone() == (SURVEY_SWEEPS + 1,)
    assert "damage" not in ran("noctule-gateway", "check", gateway)
    ran("noctule-mapper", "check", mapper)


@pytest.mark.soak
def test_restoring_only_the_gateways_copy_under_a_running_mapper_uses_no_number_twice_and_misses_no_sweep(
    tmp_path: Path,
) -> None:
    room = paper_room(tmp_path)
    gateway, copy, store = tmp_path / "gateway", tmp_path / "copy", tmp_path / f"mapper/{SITE}.sqlite3"
    with programs(tmp_path) as running:
        running.start("simulator", *room.simulator(speed=24))
        start(room, running)
        before = wait_for_contour(room, running)
        ran("noctule-gateway", "backup", gateway, copy)
        another_sweep(room, running, SURVEY_SWEEPS + 1)
        first = logged_sweeps(room)
        assert running.end("gateway") == 0

        restore(copy, gateway)
        running.start("gateway", *room.gateway())
        wait_until(lambda: "has log" in running.log("mapper"), "the mapper does not see that the log is another")
        another_sweep(room, running, SURVEY_SWEEPS + 1)  # the mapper still holds as many, so that says little
        wait_for_sweeps(room, running, SURVEY_SWEEPS + 1)
        second = logged_sweeps(room)
        new = [(sweep.log_id, sweep.log_sequence) for sweep in second]
        wait_until(lambda: set(new) <= stored(store), "the mapper has not read the restored log")
        after = map_with(room, running, second[-1])
        end(running)
        running.end("simulator")

    assert [facts(sweep) for sweep in second[:-1]] == [facts(sweep) for sweep in first[:-1]]
    assert facts(second[-1]) != facts(first[-1])
    assert set(new).isdisjoint((sweep.log_id, sweep.log_sequence) for sweep in first)
    assert stored(store) == set(new)  # each place by what the restored log has of it
    assert len(after.walls) == len(before.walls) and len(after.corners) == len(before.corners)


def map_with(room: PaperRoom, running: Programs, newest: Sweep) -> Contour:
    """The first map whose newest sweep is ``newest``."""

    def mapped() -> Contour | None:
        running.check()
        contour = client.contour()
        return contour if contour is not None and abs(contour.time.ToMicroseconds() - start_us) <= 1 else None

    start_us = newest.start.ToMicroseconds()
    with Client(SITE, connect=[room.connect]) as client:
        return wait_until(mapped, "no map rests on the newest sweep of the restored log")


def stored(store: Path) -> set[tuple[str, int]]:
    """The sweeps that a mapper's store holds."""
    with closing(sqlite3.connect(store)) as database:
        return set(database.execute("SELECT log_id, log_sequence FROM sweep").fetchall())


def facts(sweep: Sweep) -> tuple[int, int, bytes]:
    """What was measured, without the log that it stands in."""
    return sweep.log_sequence, sweep.sequence, b"".join(each.SerializeToString() for each in sweep.readings)


def test_a_unit_that_takes_anothers_place_goes_on_with_its_name_and_log(tmp_path: Path) -> None:
    unit_port = free_port_range(2)
    new_port = unit_port + 1  # the simulator counts on
    (zenoh_port,) = free_ports(1)
    site = tmp_path / "site.toml"
    text = (ROOT / "deploy/demo/sites/lounge.toml").read_text()
    head, old, new = text.split("[[unit]]")
    old = old.replace("127.0.0.1:7101", f"127.0.0.1:{unit_port}")
    site.write_text(f"{head}[[unit]]{old}")
    data = tmp_path / "gateway"
    listen = f"tcp/127.0.0.1:{zenoh_port}"
    gateway = ["noctule-gateway", "run", str(site), "--data", str(data), "--listen", listen]

    def logged(running: Programs, count: int) -> list[Sweep]:
        def enough() -> bool:
            running.check()
            return any(each.unit == "u1" and each.log_head >= count for each in client.unit_statuses())

        with Client("lounge", connect=[listen]) as client:
            wait_until(enough, f"fewer than {count} sweeps of u1 in the log")
            records = client.log("u1", from_sequence=1)
        assert records is not None
        return list(records.sweeps)

    with programs(tmp_path) as running:
        simulator = "noctule-sim --firmware firmware/build/noctule.ihx --room lounge --units 2 --speed 24"
        running.start(
            "simulator", *simulator.split(), "--exact-clocks", "--seed", "7", "--tcp", f"127.0.0.1:{unit_port}"
        )
        running.start("gateway", *gateway)
        before = logged(running, 3)
        assert running.end("gateway") == 0

        # The other unit is plugged in, and the site file is still of the one before.
        moved = new.replace('name = "u2"', 'name = "u1"')
        site.write_text(f"{head}[[unit]]{moved.replace('serial = 2', 'serial = 1')}".replace(":7102", f":{new_port}"))
        running.start("gateway", *gateway)
        wait_until(lambda: "answers where the site file has" in running.log("gateway"), "the other unit is not refused")
        assert running.end("gateway") == 0

        site.write_text(f"{head}[[unit]]{moved}".replace(":7102", f":{new_port}"))
        running.start("gateway", *gateway)
        wait_until(lambda: running.log("gateway").count("on the bus: ") == 3, "the gateway is not on the bus again")
        accepted = ran("noctule", "rpc", "lounge", "u1", "accept_room", "--connect", listen)
        assert "its gateway learns again what it hears" in accepted
        after = logged(running, len(before) + 3)
        for name in ("gateway", "simulator"):
            assert running.end(name) == 0, running.log(name)

    assert {sweep.log_id for sweep in after} == {before[0].log_id}
    assert [sweep.log_sequence for sweep in after] == list(range(1, len(after) + 1))
    assert after[len(before) - 1].SerializeToString() == before[-1].SerializeToString()
    assert {sweep.unit for sweep in after} == {"u1"}
    ran("noctule-gateway", "check", data)
