"""A log with a flipped bit, a cut, an exchanged row or a lost commit: nothing altered is served, nothing ends silently.

The gateway before schema 3 broke 60 of the first 150 trials here: 18 altered sweeps were served, 26 logs lost sweeps in
silence or used their sequences again, 13 stopped, and 3 ended the reader with a DecodeError.
"""

import shutil
import sqlite3
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest
from gateway.log_faults import SWEEPS, KilledLog, copied_unnoticed, faults, killed_log, known_to_head_file
from gateway.test_sweep_log import append, arrival, opened, read
from system.processes import two_processes

from noctule import bounds, elapsed
from noctule.elapsed import Instant
from noctule.messages_pb2 import LogRecords
from noctule_gateway.bus.log_reply import read_records
from noctule_gateway.errors import LogError
from noctule_gateway.log import head_file
from noctule_gateway.log.head_file import HeadFile, Newest, Reserved, file_identity
from noctule_gateway.log.log_file import Committed, Retention
from noctule_gateway.log.log_reader import LogSlice
from noctule_gateway.log.sweep_log import SweepLog


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> KilledLog:
    return killed_log(tmp_path_factory.mktemp("killed") / "log")


def test_flips_and_cuts_at_seeded_places_of_every_file_alter_nothing_and_stop_nothing() -> None:
    outcomes, wrong = faults(range(200))
    assert outcomes == Counter(right=200), wrong[:5]


@pytest.mark.soak
def test_ten_thousand_flips_and_cuts_alter_nothing_and_stop_nothing() -> None:
    with two_processes() as pool:
        parts = list(pool.map(faults, (range(10_000 * part, 10_000 * part + 2500) for part in range(1, 5))))
    outcomes = sum((outcomes for outcomes, _ in parts), Counter[str]())
    assert outcomes == Counter(right=10_000), [each for _, wrong in parts for each in wrong][:5]


def spoiled(path: Path, *statements: str) -> None:
    """Change a closed log as no gateway would."""
    with closing(sqlite3.connect(path)) as db, db:
        for statement in statements:
            db.execute(statement)


def written(path: Path, sweeps: int = 10) -> str:
    """Make a log of ``sweeps`` and close it; its log_id."""
    with opened(path) as log:
        append(log, *map(arrival, range(sweeps)))
        return log.state.log_id


def read_after_rebuild(log: SweepLog, first: int = 1) -> LogSlice:
    """What a reader gets that asks again: the first answer may say that the log is damaged."""
    try:
        return log.read(first, 10_000, 2**30)
    except LogError:
        append(log, arrival(99))  # the log's thread takes what comes in turn: it has rebuilt the log before this
        return log.read(first, 10_000, 2**30)


@pytest.mark.parametrize(
    ("statement", "lost"),
    [
        ("UPDATE sweeps SET boot = 7 WHERE log_sequence = 4", [4]),
        ("UPDATE sweeps SET start_tick = 7 WHERE log_sequence = 4", [4]),
        ("UPDATE sweeps SET committed_elapsed_s = 7 WHERE log_sequence = 4", [4]),
        ("UPDATE sweeps SET record = (SELECT record FROM sweeps WHERE log_sequence = 5) WHERE log_sequence = 4", [4]),
        ("UPDATE sweeps SET record = 12 WHERE log_sequence = 4", [4]),
        ("DELETE FROM sweeps WHERE log_sequence BETWEEN 4 AND 6", [4, 5, 6]),
        ("DELETE FROM sweeps WHERE log_sequence = 1", [1]),
        ("DELETE FROM sweeps WHERE log_sequence = 10", [10]),
        ("UPDATE sweeps SET log_sequence = 4000 WHERE log_sequence = 4", [4]),
    ],
)
def test_a_changed_missing_or_moved_record_is_a_gap_with_its_reason_and_all_others_are_served(
    tmp_path: Path, statement: str, lost: list[int]
) -> None:
    path = tmp_path / "u1.sqlite"
    log_id = written(path)
    spoiled(path, statement)
    with opened(path) as log:
        found = read_after_rebuild(log)
        assert found.log_id == log_id
        sequences = [sweep.log_sequence for sweep in read(log)]
        assert [sequence for sequence in sequences if sequence <= 10] == [
            sequence for sequence in range(1, 11) if sequence not in lost
        ]
        assert [n for gap in found.gaps for n in range(gap.first, gap.last + 1) if gap.damaged] == lost
        assert log.state.damaged == len(lost)
        assert f"the last is sweep {lost[-1]}: " in log.state.damage
        assert "the old files are in set-aside/u1.1" in log.state.damage


@pytest.mark.parametrize("table", ["log", "sweeps", "gaps"])
@pytest.mark.parametrize("fault", ["DELETE FROM {}", "DROP TABLE {}"])
def test_an_empty_or_a_missing_table_stops_no_log_and_its_sweeps_are_served_or_stated_as_lost(
    tmp_path: Path, table: str, fault: str
) -> None:
    path = tmp_path / "u1.sqlite"
    log_id = written(path)
    spoiled(path, fault.format(table))
    with opened(path) as log:
        assert isinstance(append(log, arrival(50))[0], Committed)
        held = [sweep.log_sequence for sweep in read(log)]
        stated = [n for gap in log.read(1, 10_000, 2**30).gaps for n in range(gap.first, gap.last + 1)]
        is_another_log = log.state.log_id != log_id
        assert is_another_log or {*held, *stated} >= set(range(1, 11))
        if table == "sweeps":
            assert log.state.damage or is_another_log


def test_a_row_that_is_sound_by_itself_and_not_the_one_that_was_logged_there_is_found_by_its_neighbours(
    tmp_path: Path,
) -> None:
    path, other = tmp_path / "u1.sqlite", tmp_path / "other.sqlite"
    written(path, 3)
    for suffix in ("", "-head"):
        shutil.copy(f"{path}{suffix}", f"{other}{suffix}")
    known_to_head_file(other)
    with opened(path) as log:
        append(log, *map(arrival, range(3, 8)))
    with opened(other) as log:  # the same log goes on elsewhere: its sweep 4 is sealed with the same log_id
        append(log, *map(arrival, range(20, 25)))
    spoiled(
        path,
        f"ATTACH '{other}' AS other",
        "DELETE FROM sweeps WHERE log_sequence = 4",
        "INSERT INTO sweeps SELECT * FROM other.sweeps WHERE log_sequence = 4",
    )
    with opened(path) as log:
        found = read_after_rebuild(log)
        assert [sweep.sequence for sweep in read(log) if sweep.sequence < 90] == [0, 1, 2, 4, 5, 6, 7]
        assert [(gap.first, gap.last) for gap in found.gaps] == [(4, 4)]


def test_retention_leaves_a_chain_that_is_sound_from_the_tail_on(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path, Retention(max_bytes=500)) as log:
        append(log, *map(arrival, range(100)))
        state = log.state
        assert state.tail > 80
    with opened(path) as log:
        assert [sweep.log_sequence for sweep in read(log)] == list(range(state.tail, 101))
        assert (log.state.removed, log.state.damaged, log.state.damage) == (state.tail - 1, 0, "")


def test_a_resend_of_a_damaged_sweep_is_logged_again_under_a_new_sequence(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    written(path)
    spoiled(path, "UPDATE sweeps SET record = x'ff' WHERE log_sequence = 4")
    with opened(path) as log:
        (result,) = append(log, arrival(3))
        assert isinstance(result, Committed)
        assert (result.fresh, result.log_sequence) == (True, 11)
        assert {sweep.sequence for sweep in read(log)} == set(range(10))


def test_commits_that_the_wal_has_lost_leave_a_gap_and_their_sequences_are_not_used_again(
    tmp_path: Path, left: KilledLog
) -> None:
    folder = tmp_path / "data"
    copied_unnoticed(left.folder, folder)
    wal = folder / "u1.sqlite-wal"
    wal.write_bytes(wal.read_bytes()[: wal.stat().st_size // 10])
    with opened(folder / "u1.sqlite", now=elapsed.now) as log:  # the same boot of the kernel
        found = log.read(1, 10_000, 2**30)
        held = len(found.records)
        assert 0 < held < SWEEPS
        assert [(gap.first, gap.last, gap.damaged) for gap in found.gaps] == [(held + 1, SWEEPS, True)]
        assert (found.log_id, found.head, log.state.damaged) == (left.log_id, SWEEPS, SWEEPS - held)
        assert "its newest commits are gone" in log.state.damage
        (result,) = append(log, arrival(500))
        assert isinstance(result, Committed)
        assert result.log_sequence == SWEEPS + 1


def test_after_a_power_cut_no_sequence_is_used_that_a_lying_disk_may_have_lost_and_nobody_is_alarmed(
    tmp_path: Path, left: KilledLog
) -> None:
    folder = tmp_path / "data"
    copied_unnoticed(left.folder, folder)
    copy = tmp_path / "copy"
    with opened(folder / "u1.sqlite", now=lambda: Instant(0.0, "the next boot", 0.0)) as log:
        found = log.read(1, 10_000, 2**30)
        copied_unnoticed(folder, copy)
    assert len(found.records) == SWEEPS
    (gap,) = found.gaps
    assert (gap.first, gap.damaged) == (SWEEPS + 1, False)
    assert gap.last >= 1000  # the step of a reservation, head_file.py
    assert (log.state.damaged, log.state.damage) == (0, "")
    # A second power cut before any commit skips nothing more.
    with opened(copy / "u1.sqlite", now=lambda: Instant(0.0, "one more boot", 0.0)) as log:
        assert log.state.head == found.head
        (result,) = append(log, arrival(500))
        assert isinstance(result, Committed)
        assert result.log_sequence == found.head + 1


@pytest.mark.parametrize("damage", ["deleted", "emptied"])
def test_a_log_that_its_head_file_does_not_know_keeps_its_sweeps_under_a_new_id(tmp_path: Path, damage: str) -> None:
    path = tmp_path / "u1.sqlite"
    log_id = written(path)
    head = tmp_path / "u1.sqlite-head"
    head.unlink() if damage == "deleted" else head.write_bytes(b"")
    with opened(path) as log:
        assert log.state.log_id != log_id
        assert [sweep.sequence for sweep in read(log)] == list(range(10))
        assert {sweep.log_id for sweep in read(log)} == {log.state.log_id}
        assert "its head file does not know it" in log.state.damage


@pytest.mark.parametrize("how", ["copied elsewhere", "put back", "closed and put back"])
def test_a_copy_of_a_logs_files_goes_on_under_a_new_id_and_a_log_that_was_moved_does_not(
    tmp_path: Path, how: str
) -> None:
    """As rsync, tar or cp copy them. Numbers that the log has used since would else be used again."""
    data, copy = tmp_path / "data", tmp_path / "copy"
    data.mkdir()
    if not file_identity(_touched(data)):
        pytest.skip("this file system gives files no identity")
    with opened(data / "u1.sqlite") as log:
        append(log, *map(arrival, range(10)))
        if how != "closed and put back":
            shutil.copytree(data, copy)
        log_id = log.state.log_id
    if not copy.exists():
        shutil.copytree(data, copy)
    data.rename(tmp_path / "moved")
    with opened(tmp_path / "moved" / "u1.sqlite") as log:
        append(log, arrival(10))
        assert (log.state.log_id, log.state.head) == (log_id, 11)
    if how != "copied elsewhere":
        shutil.rmtree(tmp_path / "moved")
        shutil.copytree(copy, data)
        copy = data
    with opened(copy / "u1.sqlite") as log:
        append(log, arrival(30))
        assert log.state.log_id != log_id
        assert [sweep.sequence for sweep in read(log)] == [*range(10), 30]
        assert "the log was copied here" in log.state.damage
        copy_id = log.state.log_id
    with opened(copy / "u1.sqlite") as log:
        assert log.state.log_id == copy_id


def _touched(folder: Path) -> Path:
    path = folder / "file"
    path.write_bytes(b"")
    return path


@pytest.mark.parametrize("size_bytes", [0, 1, 99])  # SQLite's header has 100 bytes
def test_an_empty_file_is_not_taken_for_a_new_log(tmp_path: Path, size_bytes: int) -> None:
    path = tmp_path / "u1.sqlite"
    log_id = written(path)
    path.write_bytes(path.read_bytes()[:size_bytes])
    with opened(path) as log:
        (result,) = append(log, arrival(50))
        assert isinstance(result, Committed)
        assert log.state.log_id == log_id
        assert result.log_sequence > 10
        assert (log.state.damaged, "10 of its sweeps are lost" in log.state.damage) == (10, True)
    assert (tmp_path / "set-aside" / "u1.1" / "u1.sqlite").stat().st_size == size_bytes


@pytest.mark.parametrize("moved", range(4))
def test_a_rebuilt_log_takes_its_place_wherever_the_gateway_was_killed(tmp_path: Path, moved: int) -> None:
    path = tmp_path / "u1.sqlite"
    written(path)
    (tmp_path / "rebuilt").mkdir()
    written(tmp_path / "rebuilt" / "u1.sqlite", 4)
    (tmp_path / "rebuilt" / "u1.sqlite").rename(f"{path}-ready")
    spoiled(Path(f"{path}-ready"), "UPDATE log SET adopted = 0")
    for suffix in ("-head", "-wal", "")[:moved]:
        if Path(f"{path}{suffix}").exists():
            (tmp_path / "set-aside" / "u1.1").mkdir(parents=True, exist_ok=True)
            Path(f"{path}{suffix}").rename(tmp_path / "set-aside" / "u1.1" / f"u1.sqlite{suffix}")
    with opened(path) as log:
        assert [sweep.sequence for sweep in read(log)] == [0, 1, 2, 3]
    assert sorted(each.name for each in (tmp_path / "set-aside" / "u1.1").iterdir()) == ["u1.sqlite", "u1.sqlite-head"]


def test_readers_that_never_pause_see_the_rebuilt_file_at_once_and_not_the_damaged_one(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    for trial in range(40):
        written(path)
        spoiled(path, "UPDATE sweeps SET record = x'ff' WHERE log_sequence = 4")
        with opened(path) as log, reading_all_the_time(log):
            results = [result for sequence in range(20, 30) for result in append(log, arrival(sequence))]
            assert all(isinstance(result, Committed) for result in results), (trial, results)
        shutil.rmtree(tmp_path)
        tmp_path.mkdir()


@contextmanager
def reading_all_the_time(log: SweepLog) -> Iterator[None]:
    ended = threading.Event()

    def read_on() -> None:
        while not ended.is_set():
            with suppress(LogError):
                log.read(1, 10_000, 2**30)

    readers = [threading.Thread(target=read_on) for _ in range(3)]
    for reader in readers:
        reader.start()
    try:
        yield
    finally:
        ended.set()
        for reader in readers:
            reader.join()


def test_a_reply_of_the_log_states_the_damage_within_the_bounds_of_the_bus(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    written(path)
    spoiled(path, "DELETE FROM sweeps WHERE log_sequence BETWEEN 4 AND 6")
    with opened(path) as log:
        read_after_rebuild(log)
        reply = bounds.decode(LogRecords, read_records(log, {"from": "1", "max": "5"}.get))
    assert [sweep.log_sequence for sweep in reply.sweeps] == [1, 2, 3, 7, 8]
    assert [(gap.first, gap.last, gap.damaged) for gap in reply.gaps] == [(4, 6, True)]


def test_the_longest_lines_of_a_head_file_are_read_back(tmp_path: Path) -> None:
    # Inodes of XFS and of network file systems have 64 bits, generations 32; a log_sequence has 53 (noctule.bounds).
    newest = Newest("f" * 16, 2**53 - 1, "f" * 32, "f" * 36, False, f"{2**64 - 1}.{2**32 - 1}")
    head = HeadFile(tmp_path / "head")
    head.begin(newest, reserved=0)
    head.close()
    heads = head_file.read(tmp_path / "head", newest.file)
    assert (heads.newest, heads.reserved) == (newest, Reserved(newest.log_id, newest.head))
