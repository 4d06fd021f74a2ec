"""The mapper's store: nothing twice, nothing lost, nothing beyond the window."""

import math
import re
import resource
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from random import Random

import numpy as np
import pytest
from mapper.room import paper_path
from sdk.host_clocks import Host

from noctule.elapsed import Instant
from noctule.messages_pb2 import FAULT_KIND_TURNED, Cursor, Pose, Sweep
from noctule_mapper.cli import main
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.readings.faulty import suspects

LOG = "8c1f"


def sweep(number: int, start_s: float | None = None, x_m: float | None = None) -> Sweep:
    """The ``number``th sweep of a log; by default each from a place of its own, one second apart."""
    pose = Pose(x_m=number if x_m is None else x_m)
    message = Sweep(unit="u1", log_id=LOG, log_sequence=number, clock_epoch="one", pose=pose)
    message.start.FromNanoseconds(int((number if start_s is None else start_s) * 1e9))
    return message


def stop(number: int, x_m: float, heading_deg: float = 0.0, unit: str = "u1", log: str = LOG) -> Sweep:
    """A sweep of a unit that may turn, or stand beside another."""
    pose = Pose(x_m=x_m, heading_rad=math.radians(heading_deg))
    return Sweep(unit=unit, log_id=log, log_sequence=number, pose=pose, start=sweep(number).start)


def walk(poses: np.ndarray, first: int) -> list[Sweep]:
    """A sweep at each pose (x, y, heading), numbered from ``first``."""
    made = [sweep(first + step) for step in range(len(poses))]
    for message, (x_m, y_m, heading_rad) in zip(made, poses, strict=True):
        message.pose.CopyFrom(Pose(x_m=x_m, y_m=y_m, heading_rad=heading_rad))
    return made


def cursor(number: int) -> Cursor:
    return Cursor(unit="u1", log_id=LOG, log_sequence=number)


def sequences(store: SweepStore) -> list[int]:
    return [held.log_sequence for held in store.sweeps()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "paper-room.sqlite3"


def test_a_sweep_that_is_delivered_twice_is_held_once(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2)], [cursor(2)])
    again = store.commit([sweep(2), sweep(3)], [cursor(3)])
    assert [entered.log_sequence for entered in again.entered] == [3]
    assert again.left == ()
    assert sequences(store) == [1, 2, 3]
    store.close()


def test_sweeps_and_cursors_outlive_the_process(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(2), sweep(1)], [cursor(2)])
    store.close()
    reopened = SweepStore(path, Window())
    assert reopened.sweeps() == [sweep(1), sweep(2)]
    assert reopened.cursors() == {"u1": cursor(2)}
    reopened.close()


def test_a_sweep_that_is_set_aside_never_comes_back(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2), sweep(3)], [cursor(3)])
    store.set_aside((LOG, 2), "IndexError: 64")
    store.close()
    reopened = SweepStore(path, Window())
    assert sequences(reopened) == [1, 3]
    assert reopened.commit([sweep(2)], [cursor(3)]).entered == ()
    assert sequences(reopened) == [1, 3]
    assert reopened.sweeps_set_aside() == [("u1", (LOG, 2), "IndexError: 64")]
    reopened.close()


def test_sweeps_that_are_set_aside_are_bounded_by_the_window(path: Path) -> None:
    host = Host()
    store = SweepStore(path, Window(max_age_s=60.0, max_sweeps=3), host)
    for number in range(1, 6):
        store.commit([sweep(number)], [cursor(number)])
        store.set_aside((LOG, number), "a bug")
        host.pass_time(1.0)
    assert [identity[1] for _, identity, _ in store.sweeps_set_aside()] == [3, 4, 5]
    host.pass_time(60.0)
    store.set_aside((LOG, 99), "not here any more")
    assert store.sweeps_set_aside() == []
    store.close()


def test_the_window_keeps_its_limit_after_a_disk_was_full(path: Path) -> None:
    host = Host()
    store = SweepStore(path, Window(max_age_s=60.0, max_sweeps=20), host)
    store.commit([sweep(number) for number in range(1, 11)], [cursor(10)])
    host.pass_time(100.0)
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    written = path.with_name(path.name + "-wal").stat().st_size
    resource.setrlimit(resource.RLIMIT_FSIZE, (written, limit[1]))
    try:
        for _ in range(5):  # each takes out the ten that are too old, and fails
            with pytest.raises(StoreError):
                store.commit([sweep(11)], [cursor(11)])
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    host.pass_time(-100.0)
    store.commit([sweep(number, start_s=1000 + number) for number in range(11, 71)], [cursor(70)])
    assert sequences(store) == list(range(51, 71))
    store.close()


def test_the_cursor_moves_over_sweeps_that_are_not_worth_keeping(path: Path) -> None:
    store = SweepStore(path, Window())
    assert store.commit([], [cursor(7)]).entered == ()
    assert store.cursors()["u1"].log_sequence == 7
    store.close()


def test_a_cursor_follows_its_unit_into_a_new_log(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(9)], [cursor(9)])
    reborn = Cursor(unit="u1", log_id="d2e0", log_sequence=1)
    store.commit([], [reborn])
    assert store.cursors() == {"u1": reborn}
    store.close()


def test_sweeps_older_than_the_window_leave_it(path: Path) -> None:
    store = SweepStore(path, Window(max_age_s=10))
    store.commit([sweep(1), sweep(5), sweep(11)], [cursor(11)])
    assert sequences(store) == [1, 5, 11]
    assert store.commit([sweep(14)], [cursor(14)]).left == ((LOG, 1),)
    assert sequences(store) == [5, 11, 14]
    store.close()


def test_the_window_holds_no_more_than_its_count_and_lets_the_oldest_go(path: Path) -> None:
    store = SweepStore(path, Window(max_sweeps=3))
    change = store.commit([sweep(number) for number in range(1, 6)], [cursor(5)])
    assert [entered.log_sequence for entered in change.entered] == [3, 4, 5]
    assert change.left == ()
    assert store.commit([sweep(6)], [cursor(6)]).left == ((LOG, 3),)
    store.close()


def test_of_one_visit_to_a_place_the_newest_sweeps_stay(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=2))
    assert store.commit([sweep(1, x_m=0.0), sweep(2, x_m=0.004)], []).left == ()
    assert store.commit([sweep(3, x_m=-0.004)], []).left == ((LOG, 1),)
    store.commit([sweep(4, x_m=1.0)], [])
    assert sequences(store) == [2, 3, 4]
    store.close()


def test_a_new_visit_to_a_place_supersedes_all_that_the_last_one_left(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=2))
    store.commit([sweep(1, x_m=0.0), sweep(2, x_m=0.0), sweep(3, x_m=1.0)], [])
    change = store.commit([sweep(4, x_m=0.004)], [])
    assert sorted(change.left) == [(LOG, 1), (LOG, 2)]
    store.commit([sweep(5, x_m=0.004)], [])
    assert sequences(store) == [3, 4, 5]
    store.close()


@pytest.mark.parametrize("shift_m", [0.0, 0.025, 0.05])  # a path on the borders of any raster that one may think of
def test_a_round_of_a_path_leaves_nothing_of_the_round_before_however_the_poses_waver(
    path: Path, shift_m: float
) -> None:
    store = SweepStore(path, Window())
    rng = np.random.default_rng(5)
    poses = paper_path() + np.array([shift_m, shift_m, 0.0])
    for first in range(1, 5 * len(poses), len(poses)):
        noise = rng.normal(0, [0.004, 0.004, math.radians(1.0)], poses.shape)
        store.commit(walk(poses + noise, first), [])
        assert sequences(store) == list(range(first, first + len(poses)))
    store.close()


def test_a_unit_that_creeps_leaves_a_trail_and_the_next_round_takes_its_place(path: Path) -> None:
    store = SweepStore(path, Window())
    steps = np.arange(100)
    trail = np.column_stack([0.01 * steps, 0 * steps, 0 * steps])
    store.commit(walk(trail, 1), [])
    held_m = [one.pose.x_m for one in store.sweeps()]
    assert max(np.diff(held_m)) < 2 * Window().place_radius_m
    store.commit(walk(trail + np.array([0.003, 0.0, 0.0]), 101), [])
    assert min(sequences(store)) > 100
    store.close()


def test_a_place_is_of_one_unit_and_one_heading(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([stop(1, 0.0), stop(2, 1.0)], [])
    assert store.commit([stop(3, 0.0, heading_deg=90.0)], []).left == ()
    assert store.commit([stop(4, 0.0, unit="u2", log="77aa")], []).left == ()
    assert store.commit([stop(5, 0.0, heading_deg=355.0)], []).left == ((LOG, 1),)
    store.close()


def test_a_restart_in_the_midst_of_a_visit_changes_nothing(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=2))
    store.commit([sweep(1, x_m=0.0), sweep(2, x_m=1.0), sweep(3, x_m=0.0)], [])
    store.close()
    reopened = SweepStore(path, Window(sweeps_per_place=2))
    assert reopened.commit([sweep(4, x_m=0.0)], []).left == ()
    assert sequences(reopened) == [2, 3, 4]
    reopened.close()


def test_a_sweep_that_comes_after_newer_ones_from_its_place_displaces_none(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1, x_m=1.0), sweep(3, x_m=0.0), sweep(4, x_m=1.0), sweep(5, x_m=0.0)], [])
    late = store.commit([sweep(2, x_m=0.0)], [])
    assert late.entered == late.left == ()
    assert sequences(store) == [4, 5]
    store.close()


def test_what_a_unit_logs_anew_supersedes_what_it_had_in_the_log_before(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([stop(8, 0.0), stop(9, 0.0)], [])
    change = store.commit([stop(1, 0.0, log="d2e0")], [])
    assert sorted(change.left) == [(LOG, 8), (LOG, 9)]
    store.close()


def test_a_sweep_that_comes_too_late_for_the_window_changes_nothing(path: Path) -> None:
    store = SweepStore(path, Window(max_age_s=10))
    store.commit([sweep(2, start_s=100)], [cursor(2)])
    late = store.commit([sweep(1, start_s=1)], [cursor(2)])
    assert late.entered == late.left == ()
    store.close()


def test_a_sweep_from_the_future_does_not_empty_the_window(path: Path) -> None:
    store = SweepStore(path, Window(max_age_s=10), lambda: Instant(20.0, "boot", 20.0))
    store.commit([sweep(15), sweep(16, start_s=1e6), sweep(17)], [cursor(17)])
    assert sequences(store) == [15, 16, 17]
    store.close()


def test_sweeps_after_a_clock_was_set_back_supersede_those_before(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=2, max_sweeps=3))
    store.commit([sweep(1, 5000.0, x_m=0.0), sweep(2, 5001.0, x_m=0.0), sweep(3, 5002.0)], [cursor(3)])
    change = store.commit([sweep(4, 1400.0, x_m=0.0), sweep(5, 1401.0)], [cursor(5)])
    assert [entered.log_sequence for entered in change.entered] == [4, 5]
    assert sorted(change.left) == [(LOG, 1), (LOG, 2)]
    store.close()


def test_a_failed_commit_leaves_the_store_as_it_was(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1)], [cursor(1)])

    def breaks_off():
        yield sweep(2)
        raise OSError("the source went away")

    with pytest.raises(OSError, match="the source went away"):
        store.commit(breaks_off(), [cursor(2)])
    assert sequences(store) == [1]
    assert store.cursors()["u1"].log_sequence == 1
    store.close()


def test_contour_versions_go_on_counting_after_a_restart(path: Path) -> None:
    store = SweepStore(path, Window())
    assert [store.next_contour_version(), store.next_contour_version()] == [1, 2]
    store.close()
    reopened = SweepStore(path, Window())
    assert reopened.next_contour_version() == 3
    reopened.close()


def test_no_contour_version_is_used_again_by_the_successor_of_a_killed_mapper(path: Path) -> None:
    store, left = SweepStore(path, Window()), path.parent / "left" / path.name
    borne = [store.next_contour_version() for _ in range(3)]
    shutil.copytree(path.parent, left.parent)  # as a kill leaves it
    borne += [store.next_contour_version() for _ in range(250)]
    assert borne == list(range(1, 254))
    store.close()
    later = SweepStore(left, Window())
    assert later.next_contour_version() > 3
    later.close()


def test_a_file_that_is_no_store_is_set_aside_and_a_new_store_begins(path: Path) -> None:
    letter = "a letter to the editor, long enough to be no database " * 40
    path.write_text(letter)
    store = SweepStore(path, Window())
    assert store.sweeps() == []
    assert "file is not a database" in store.damage
    assert (path.parent / "set-aside" / "paper-room.1" / path.name).read_text() == letter
    store.close()


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE sweep SET record = x'ffff' WHERE log_sequence = 2",
        "UPDATE sweep SET place_x_m = 70 WHERE log_sequence = 2",
        "UPDATE sweep SET log_sequence = 70 WHERE log_sequence = 2",
        "UPDATE sweep SET record = 5 WHERE log_sequence = 2",
    ],
)
def test_a_damaged_sweep_is_not_mapped_and_is_read_again_from_its_log(path: Path, statement: str) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2), sweep(3)], [cursor(3)])
    assert [store.next_contour_version() for _ in range(5)][-1] == 5
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(statement)
    reopened = SweepStore(path, Window())
    assert sequences(reopened) == [1, 3]
    assert reopened.damage.startswith("the mapper's store was damaged (1 rows of its table sweep do not fit): 2 sound")
    assert reopened.cursors() == {}
    assert reopened.next_contour_version() == 6
    reopened.commit([sweep(1), sweep(2), sweep(3)], [cursor(3)])
    assert sequences(reopened) == [1, 2, 3]
    reopened.close()
    assert SweepStore(path, Window()).damage == ""


@pytest.mark.parametrize("table", ["cursor", "contour", "set_aside"])
def test_a_damaged_row_beside_the_sweeps_loses_no_sweep(path: Path, table: str) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2)], [cursor(2)])
    store.set_aside((LOG, 2), "a bug")
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(f"UPDATE {table} SET {'version' if table == 'contour' else 'log_sequence'} = 77")
    reopened = SweepStore(path, Window())
    assert f"1 rows of its table {table} do not fit" in reopened.damage
    assert sequences(reopened) == [1]
    if table == "contour":
        assert reopened.next_contour_version() > 10**9  # above all that was counted: seconds of UTC
    reopened.close()


def flipped_or_cut(folder: Path, random: Random) -> str:
    """Flip a bit or cut a file of the store at a place drawn at random; what was done."""
    file = random.choice([each for each in sorted(folder.iterdir()) if each.is_file() and each.stat().st_size])
    text = bytearray(file.read_bytes())
    place = random.randrange(len(text))
    if random.random() < 0.2:
        del text[place:]
    else:
        text[place] ^= 1 << random.randrange(8)
    file.write_bytes(text)
    return f"{file.name} at {place}"


def test_flips_and_cuts_at_seeded_places_alter_no_sweep_of_the_store_and_end_no_mapper(tmp_path: Path) -> None:
    running, left = tmp_path / "running", tmp_path / "left"
    store = SweepStore(running / "store.sqlite3", Window())
    for number in range(1, 41):
        store.commit([sweep(number)], [cursor(number)])
    shutil.copytree(running, left)  # as a kill leaves it: all is in the -wal
    store.close()
    shutil.copytree(running, tmp_path / "closed")
    for seed in range(60):
        folder = tmp_path / "trial"
        shutil.copytree(left if seed % 2 else tmp_path / "closed", folder)
        done = flipped_or_cut(folder, Random(seed))
        spoiled = SweepStore(folder / "store.sqlite3", Window())
        held = spoiled.sweeps()
        assert all(one == sweep(one.log_sequence) for one in held), done
        reached = spoiled.cursors()["u1"].log_sequence if spoiled.cursors() else 0
        assert {one.log_sequence for one in held} >= set(range(1, reached + 1)), done  # the rest is read again
        spoiled.commit([sweep(number) for number in range(reached + 1, 42)], [cursor(41)])
        assert sequences(spoiled) == list(range(1, 42)), done
        spoiled.close()
        shutil.rmtree(folder)


@pytest.mark.parametrize("change", ["CREATE TABLE later (a)", "ALTER TABLE sweep ADD COLUMN later"])
def test_a_store_of_a_later_version_is_refused_and_left_as_it_is(path: Path, change: str) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1)], [])
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(change)
        database.execute("PRAGMA user_version = 5")
    before = path.read_bytes()
    with pytest.raises(StoreError, match="has format 5, this mapper reads 4"):
        SweepStore(path, Window())
    assert path.read_bytes() == before
    assert not (path.parent / "set-aside").exists()


def test_a_store_of_another_format_is_refused(path: Path) -> None:
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA user_version = 9")
    with pytest.raises(StoreError, match="has format 9"):
        SweepStore(path, Window())


def test_the_file_grows_no_further_once_the_window_is_full(path: Path) -> None:
    store, pages = SweepStore(path, Window(max_sweeps=100)), []
    for first in range(1, 3001, 50):
        store.commit([sweep(number) for number in range(first, first + 50)], [cursor(first + 49)])
        with closing(sqlite3.connect(path)) as reader:
            pages += reader.execute("PRAGMA page_count").fetchone()
    assert max(pages[10:]) <= max(pages[:10]) + 1
    store.close()


WRITER = """
import sys
from contextlib import closing
from pathlib import Path
from noctule.messages_pb2 import Cursor, Pose, Sweep
from noctule_mapper.cli import main
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore

store = SweepStore(Path(sys.argv[1]), Window())
number = store.cursors()["u1"].log_sequence if store.cursors() else 0
while True:
    batch = []
    for number in range(number + 1, number + 4):
        batch.append(Sweep(unit="u1", log_id="8c1f", log_sequence=number, pose=Pose(x_m=number)))
        batch[-1].start.FromSeconds(number)
    store.commit(batch, [Cursor(unit="u1", log_id="8c1f", log_sequence=number)])
    print(number, flush=True)
"""


def test_a_killed_writer_leaves_sweeps_and_cursor_that_agree(path: Path) -> None:
    for commits_seen in (1, 5, 11):
        writer = subprocess.Popen([sys.executable, "-c", WRITER, path], stdout=subprocess.PIPE, text=True)
        assert writer.stdout is not None
        acknowledged = [int(writer.stdout.readline()) for _ in range(commits_seen)]
        writer.kill()
        writer.wait()
        writer.stdout.close()
        store = SweepStore(path, Window())
        reached = store.cursors()["u1"].log_sequence
        assert reached >= acknowledged[-1]
        assert sequences(store) == list(range(1, reached + 1))
        store.close()


def test_a_power_cut_takes_the_newest_sweeps_and_their_cursor_goes_back_with_them(path: Path, tmp_path: Path) -> None:
    store, random = SweepStore(path, Window()), Random(12)
    for number in range(1, 161):
        store.commit([sweep(number)], [cursor(number)])
        if number == 60:
            store.checkpoint()  # these are in the database; the others begin the -wal again
    database, wal = path.read_bytes(), Path(f"{path}-wal").read_bytes()
    store.close()
    reached = set[int]()
    for cut in range(30):
        left = tmp_path / str(cut) / path.name
        left.parent.mkdir()
        left.write_bytes(database)
        unwritten = bytearray(wal)
        at = random.randrange(len(wal))
        if cut % 2:
            del unwritten[at:]  # the end never came to the disk
        else:
            block = at - at % 4096
            unwritten[block : block + 4096] = bytes(4096)  # what came after this block did, and the block did not
        Path(f"{left}-wal").write_bytes(unwritten)
        after = SweepStore(left, Window())
        assert after.damage == ""
        kept = after.cursors()["u1"].log_sequence if after.cursors() else 0
        assert sequences(after) == list(range(1, kept + 1))
        assert 60 <= kept <= 160
        reached.add(kept)
        after.close()
    assert len(reached) > 10, "the cuts were not at different places"


SYNCED_WRITER = """
import os, sys
from pathlib import Path
from noctule.messages_pb2 import Cursor, Pose, Sweep
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore

store = SweepStore(Path(sys.argv[1]), Window())
for number in range(1, 401):
    sweep = Sweep(unit="u1", log_id="8c1f", log_sequence=number, pose=Pose(x_m=number))
    os.write(1, b"sweep")
    store.commit([sweep], [Cursor(unit="u1", log_id="8c1f", log_sequence=number)])
    if number % 20 == 0:
        os.write(1, b"checkpoint")
        store.checkpoint()
os.write(1, b"contour")
store.next_contour_version()
os.write(1, b"end")
store.close()
"""


def test_no_sweep_waits_for_the_disk_and_the_number_of_a_contour_does(path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    trace = path.parent / "trace"
    calls = ["strace", "-f", "-qq", "-e", "trace=write,fsync,fdatasync", "-o", str(trace)]
    subprocess.run([*calls, sys.executable, "-c", SYNCED_WRITER, path], check=True, stdout=subprocess.DEVNULL)
    syncs = {"sweep": 0, "checkpoint": 0, "contour": 0}
    step = None
    for line in trace.read_text().splitlines():
        if written := re.search(r'write\(1, "(\w+)"', line):
            step = written[1]
        elif step in syncs and ("fsync(" in line or "fdatasync(" in line):
            syncs[step] += 1
    assert syncs["sweep"] == 0
    assert syncs["checkpoint"] > 0
    assert syncs["contour"] > 0


def test_check_and_backup_of_a_running_mapper_say_what_is_sound(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store, out = SweepStore(path, Window()), path.parent / "out"
    store.commit([sweep(1), sweep(2)], [cursor(2)])
    main_of(["backup", str(path.parent), str(out)], status=0)
    assert capsys.readouterr().out == "paper-room.sqlite3: 2 sweeps, all is sound\n"
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE sweep SET visit = 9")
    main_of(["check", str(path.parent)], status=1)
    assert capsys.readouterr().out == "paper-room.sqlite3: 2 rows of its table sweep do not fit\n"
    restored = SweepStore(out / path.name, Window())
    assert (sequences(restored), restored.damage) == ([1, 2], "")
    restored.close()


def main_of(arguments: list[str], status: int) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert (ended.value.code or 0) == status


def test_sweeps_that_turn_out_suspect_leave_the_window_once_and_for_all(path: Path) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(number) for number in range(1, 6)], [cursor(5)])
    found = Sweep(unit="u1", log_id=LOG, log_sequence=6, faults=[FAULT_KIND_TURNED], suspect_before=2)
    change = store.commit([], [cursor(6)], suspects([found]))
    assert (sorted(change.left), sequences(store)) == ([(LOG, 4), (LOG, 5)], [1, 2, 3])
    store.close()
    store = SweepStore(path, Window())
    # The cursor was set back: the sweeps come again, and so does what makes them suspect.
    change = store.commit([sweep(4), sweep(5)], [cursor(6)], suspects([found]))
    assert (change.entered, sequences(store)) == ((), [1, 2, 3])
    store.close()


def test_sweeps_that_are_suspect_when_they_come_supersede_no_good_ones(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=8))
    good, doubtful = ([sweep(number, x_m=0.0) for number in span] for span in (range(1, 31), range(31, 39)))
    store.commit(good, [cursor(30)])
    found = Sweep(unit="u1", log_id=LOG, log_sequence=39, faults=[FAULT_KIND_TURNED], suspect_before=8)
    change = store.commit(doubtful, [cursor(39)], suspects([*doubtful, found]))
    assert (change.entered, change.left, sequences(store)) == ((), (), list(range(23, 31)))
    store.close()
