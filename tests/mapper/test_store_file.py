"""The file of the mapper's store: damage, other versions, kills and power cuts, checks and copies."""

import errno
import os
import re
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory

import pytest
from mapper.stored_sweeps import LOG, cursor, sequences, sweep
from system.processes import two_processes

from noctule.elapsed import Instant
from noctule_mapper.cli import main
from noctule_mapper.config import Window
from noctule_mapper.live import newest_commit
from noctule_mapper.live.store import SweepStore
from noctule_mapper.live.store_file import StoreError


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "paper-room.sqlite3"


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


def flips_and_cuts(seeds: range) -> int:
    """How many of the stores that were spoiled so were read and went on as they must."""
    right = 0
    with TemporaryDirectory() as made:
        tmp_path = Path(made)
        running, left = tmp_path / "running", tmp_path / "left"
        store = SweepStore(running / "store.sqlite3", Window())
        for number in range(1, 41):
            store.commit([sweep(number)], [cursor(number)])
        shutil.copytree(running, left)  # as a kill leaves it: all is in the -wal
        store.close()
        shutil.copytree(running, tmp_path / "closed")
        for seed in seeds:
            folder = tmp_path / "trial"
            shutil.copytree(left if seed % 2 else tmp_path / "closed", folder)
            done = flipped_or_cut(folder, Random(seed))
            spoiled = SweepStore(folder / "store.sqlite3", Window())
            held = spoiled.sweeps()
            assert all(one == sweep(one.log_sequence) for one in held), (seed, done)
            reached = spoiled.cursors()["u1"].log_sequence if spoiled.cursors() else 0
            read = {one.log_sequence for one in held}
            assert read >= set(range(1, reached + 1)), (seed, done)  # the rest is read again
            spoiled.commit([sweep(number) for number in range(reached + 1, 42)], [cursor(41)])
            assert sequences(spoiled) == list(range(1, 42)), (seed, done)
            spoiled.close()
            shutil.rmtree(folder)
            right += 1
    return right


def test_flips_and_cuts_at_seeded_places_alter_no_sweep_of_the_store_and_end_no_mapper() -> None:
    assert flips_and_cuts(range(60)) == 60


@pytest.mark.soak
def test_five_thousand_flips_and_cuts_alter_no_sweep_of_the_store_and_end_no_mapper() -> None:
    with two_processes() as pool:
        parts = pool.map(flips_and_cuts, (range(10_000 * part, 10_000 * part + 1250) for part in range(1, 5)))
        assert sum(parts) == 5000


def test_a_store_without_its_newest_commits_is_not_sound_and_is_rebuilt(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """SQLite reads a -wal up to the first damaged frame, and says nothing of the others. Here the first half of the
    -wal is in the database already, so that old pages stand over newer ones.
    """
    store = SweepStore(path, Window())
    for number in range(1, 41):
        store.commit([sweep(number)], [cursor(number)])
        if number == 20:
            reader = sqlite3.connect(path, isolation_level=None)
            reader.execute("BEGIN")
            reader.execute("SELECT * FROM cursor").fetchone()  # until it ends, nothing beyond this is copied
            store.next_contour_version()
            with closing(sqlite3.connect(path)) as copier:
                copier.execute("PRAGMA wal_checkpoint(PASSIVE)")
    reader.close()
    numbered = [store.next_contour_version() for _ in range(3)][-1]
    left = path.parent / "left"
    left.mkdir()
    for each in path.parent.glob(f"{path.name}*"):
        shutil.copy2(each, left)  # as a kill leaves it
    store.close()
    wal = (left / f"{path.name}-wal").read_bytes()
    for place in (8, len(wal) // 4, len(wal) // 2, 3 * len(wal) // 4):  # the first is in the -wal's head
        folder = tmp_path / f"flipped at {place}"
        shutil.copytree(left, folder)
        flipped = bytearray(wal)
        flipped[place] ^= 4
        (folder / f"{path.name}-wal").write_bytes(flipped)
        main_of(["check", str(folder)], status=1)
        said = "in database main" if place == 8 else "its newest commits are gone"  # without the -wal pages differ
        assert said in capsys.readouterr().out, place
        spoiled, killed = SweepStore(folder / path.name, Window()), tmp_path / f"killed after the rebuild of {place}"
        shutil.copytree(folder, killed)
        assert SweepStore(killed / path.name, Window()).damage == ""
        assert spoiled.damage
        assert spoiled.cursors() == {}, place  # all is read again
        assert spoiled.next_contour_version() > numbered
        spoiled.commit([sweep(number) for number in range(1, 41)], [cursor(40)])
        assert sequences(spoiled) == list(range(1, 41))
        spoiled.close()
        again = SweepStore(folder / path.name, Window())
        assert again.damage == ""
        again.close()


def test_a_store_is_sound_and_goes_on_though_its_newest_commit_can_not_be_noted(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    folder = tmp_path / "not mounted"
    newest_commit.beside(path).symlink_to(folder / "newest")
    store = SweepStore(path, Window())
    for number in (1, 2):
        assert store.commit([sweep(number)], [cursor(number)]).entered == (sweep(number),)
    assert [message.split(":")[0] for message in caplog.messages] == [
        f"the newest commit of {path} can't be noted beside it"
    ]
    folder.mkdir()
    numbered = store.next_contour_version()
    noted = newest_commit.read(path)
    assert noted is not None
    assert noted.contours >= numbered
    with monkeypatch.context() as full:
        full.setattr("os.pwrite", refuse)
        store.close()  # which would give back the numbers that no contour bears
    reopened = SweepStore(path, Window())
    assert (reopened.damage, sequences(reopened)) == ("", [1, 2])
    assert reopened.next_contour_version() > numbered
    reopened.close()


def refuse(*_: object) -> int:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_store_whose_wal_holds_all_of_it_is_not_taken_for_a_new_one_after_a_flip(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    store, folder = SweepStore(path, Window()), tmp_path / "left"
    store.commit([sweep(1)], [cursor(1)])
    numbered = store.next_contour_version()
    folder.mkdir()
    for each in path.parent.glob(f"{path.name}*"):
        shutil.copy2(each, folder)  # as a kill leaves it
    store.close()
    wal = folder / f"{path.name}-wal"
    flipped = bytearray(wal.read_bytes())
    flipped[100] ^= 4
    wal.write_bytes(flipped)
    main_of(["check", str(folder)], status=1)
    assert capsys.readouterr().out == "paper-room.sqlite3: all its commits are gone\n"
    spoiled = SweepStore(folder / path.name, Window())
    assert "all its commits are gone" in spoiled.damage
    assert spoiled.next_contour_version() > numbered
    spoiled.close()
    (folder / path.name).write_bytes(b"")
    main_of(["check", str(folder)], status=1)
    assert capsys.readouterr().out == "paper-room.sqlite3: its database is gone or empty\n"
    (folder / f"{path.name}.newest").unlink()
    main_of(["check", str(folder)], status=0)  # a first opening that was cut off
    assert capsys.readouterr().out == "paper-room.sqlite3: 0 sweeps, all is sound\n"


def test_after_a_power_cut_newest_commits_may_be_gone_and_no_contour_bears_a_number_twice(path: Path) -> None:
    before = Instant(utc_s=0.0, kernel_boot="before", since_boot_s=1000.0)
    store = SweepStore(path, Window(), now=lambda: before)
    store.commit([sweep(1)], [cursor(1)])
    numbered = store.next_contour_version()
    kept = path.read_bytes()
    store.close()
    path.write_bytes(kept)  # the database alone came to the disk
    after = SweepStore(path, Window(), now=lambda: Instant(utc_s=0.0, kernel_boot="after", since_boot_s=9.0))
    assert (after.damage, sequences(after)) == ("", [])
    assert after.next_contour_version() > numbered
    after.close()


@pytest.mark.parametrize("change", ["CREATE TABLE later (a)", "ALTER TABLE sweep ADD COLUMN later"])
def test_a_store_of_a_later_version_is_refused_and_left_as_it_is(path: Path, change: str) -> None:
    store = SweepStore(path, Window())
    store.commit([sweep(1)], [])
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute(change)
        database.execute("PRAGMA user_version = 6")
    before = path.read_bytes()
    with pytest.raises(StoreError, match="has format 6, this mapper reads 5"):
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


def test_check_and_backup_of_a_running_mapper_say_what_is_sound(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out = tmp_path / "data" / "paper-room.sqlite3", tmp_path / "out"
    store = SweepStore(path, Window())
    store.commit([sweep(1), sweep(2)], [cursor(2)])
    main_of(["backup", str(path.parent), str(out)], status=0)
    assert capsys.readouterr().out == "paper-room.sqlite3: 2 sweeps, all is sound\n"
    store.close()
    with closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE sweep SET visit = 9")
    main_of(["check", str(path.parent)], status=1)
    damaged = "paper-room.sqlite3: 2 rows of its table sweep do not fit\n"
    assert capsys.readouterr().out == damaged
    main_of(["backup", str(path.parent), str(tmp_path / "damaged")], status=1)
    assert capsys.readouterr().out == damaged
    assert (tmp_path / "damaged" / path.name).exists()  # nothing better can be had
    restored = SweepStore(out / path.name, Window())
    assert (sequences(restored), restored.damage) == ([1, 2], "")
    restored.close()


def main_of(arguments: list[str], status: int) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert (ended.value.code or 0) == status
