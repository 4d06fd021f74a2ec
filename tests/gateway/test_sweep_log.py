"""The log: what is committed stays, through kills, faults and retention."""

import os
import resource
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path

import pytest

from noctule import elapsed
from noctule.elapsed import Instant
from noctule.messages_pb2 import Sweep
from noctule_gateway.errors import LogError
from noctule_gateway.log.log_file import Arrival, Committed, LogFile, Retention
from noctule_gateway.log.look import look_at_all
from noctule_gateway.log.repair import repair
from noctule_gateway.log.sweep_log import SweepLog

KEEP_ALL = Retention()


def arrival(sequence: int, boot: int = 1, digest: bytes = b"", unit: str = "u1") -> Arrival:
    sweep = Sweep(site="s", unit=unit, boot=boot, sequence=sequence, clock_error_s=0.25)
    sweep.start.FromNanoseconds((1_000_000_000 + sequence) * 10**9)
    return Arrival(digest or sequence.to_bytes(4, "little"), 4_000_000 * sequence, sweep)


@contextmanager
def opened(
    path: Path, retention: Retention = KEEP_ALL, now: Callable[[], Instant] = lambda: Instant(0.0, "boot", 0.0)
) -> Iterator[SweepLog]:
    log = SweepLog(path, retention, now)
    try:
        yield log
    finally:
        log.close()


def append(log: SweepLog, *arrivals: Arrival) -> list[Committed | LogError]:
    futures: list[Future[Committed | LogError]] = [Future() for _ in arrivals]
    for each, future in zip(arrivals, futures, strict=True):
        log.append(each, future.set_result)
    return [future.result(timeout=120) for future in futures]


def read(log: SweepLog, first: int = 1) -> list[Sweep]:
    return [Sweep.FromString(record) for record in log.read(first, 10_000, 2**30).records]


def test_a_record_is_the_sweep_with_its_place_in_the_log(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log:
        results = append(log, *map(arrival, range(5)))
        sweeps = read(log)
        log_id = log.state.log_id
    assert [sweep.log_sequence for sweep in sweeps] == [1, 2, 3, 4, 5]
    assert {sweep.log_id for sweep in sweeps} == {log_id}
    assert [sweep.sequence for sweep in sweeps] == [0, 1, 2, 3, 4]
    assert [Sweep.FromString(result.record) for result in results if isinstance(result, Committed)] == sweeps


def test_log_id_and_sequence_go_on_where_they_were_after_a_restart(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, arrival(1), arrival(2))
        before = log.state
    with opened(path) as log:
        assert log.state == before
        append(log, arrival(3))
        assert [sweep.log_sequence for sweep in read(log)] == [1, 2, 3]
    assert len(before.log_id) == 16


def test_two_logs_have_two_ids(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as one, opened(tmp_path / "u2.sqlite") as other:
        assert one.state.log_id != other.state.log_id


def test_a_resend_is_known_after_a_restart_and_gets_the_record_it_had(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        (first,) = append(log, arrival(1))
    with opened(path) as log:
        (again,) = append(log, arrival(1))
        assert log.state.head == 1
    assert isinstance(first, Committed) and isinstance(again, Committed)
    assert (again.fresh, again.record) == (False, first.record)


def test_another_sweep_under_a_number_that_was_used_before_is_new(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log:
        results = append(log, arrival(1, digest=b"one"), arrival(1, digest=b"other"))
    assert [result.fresh for result in results if isinstance(result, Committed)] == [True, True]


def test_retention_by_size_removes_the_oldest_and_counts_them(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, arrival(0))
        record_bytes = log.state.size_bytes
    with opened(path, Retention(max_bytes=10 * record_bytes + 9)) as log:
        for sequence in range(1, 50):
            append(log, arrival(sequence))
        state, kept = log.state, [sweep.log_sequence for sweep in read(log)]
    assert state.head == 50
    assert kept == list(range(state.tail, 51))
    assert 9 <= len(kept) <= 10
    assert state.removed == 50 - len(kept)
    with opened(path) as log:
        assert log.state == state


def test_the_newest_sweep_stays_whatever_its_age_and_is_known_when_the_unit_sends_it_again(tmp_path: Path) -> None:
    """A gateway was killed between a sweep's commit and its acknowledgement, for longer than its log kept sweeps: the
    unit sent the sweep again, and it was logged twice.
    """
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, arrival(1), arrival(2))
    with opened(path, Retention(max_age_s=100.0), now=lambda: Instant(0.0, "boot", 101.0)) as log:
        assert (log.state.head, log.state.tail, log.state.removed) == (2, 2, 1)
        again, fresh = append(log, arrival(2), arrival(3))
        assert (log.state.head, log.state.tail, log.state.removed) == (3, 3, 2)
    assert isinstance(again, Committed)
    assert (again.log_sequence, again.fresh) == (2, False)
    assert isinstance(fresh, Committed)
    assert (fresh.log_sequence, fresh.fresh) == (3, True)


def test_a_read_is_bounded_by_count_and_by_bytes_but_gives_at_least_one(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log:
        append(log, *map(arrival, range(20)))
        size = log.state.size_bytes // 20
        by_count = log.read(5, max_records=3, max_bytes=2**20)
        by_bytes = log.read(5, max_records=100, max_bytes=4 * size + size // 2)
        one = log.read(5, max_records=100, max_bytes=1)
        past = log.read(21, max_records=100, max_bytes=2**20)
    assert [len(each.records) for each in (by_count, by_bytes, one, past)] == [3, 4, 1, 0]
    assert (past.head, past.tail) == (20, 1)


def test_the_newest_sweep_of_a_boot_gives_its_tick_and_time(tmp_path: Path) -> None:
    with opened(tmp_path / "u1.sqlite") as log:
        append(log, arrival(1, boot=1), arrival(2, boot=1), arrival(3, boot=2))
        found = log.last_of_boot(1)
        assert log.last_of_boot(9) is None
    assert found is not None
    tick, sweep = found
    assert (tick, sweep.start.seconds, sweep.clock_error_s) == (8_000_000, 1_000_000_002, 0.25)


def test_a_file_that_is_no_log_is_set_aside_whole_and_a_new_log_begins(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    letter = b"not a database at all" * 100
    path.write_bytes(letter)
    with opened(path) as log:
        (result,) = append(log, arrival(1))
        assert isinstance(result, Committed)
        assert log.state.error == ""
        assert "the old files are in set-aside/u1.1" in log.state.damage
        assert len(read(log)) == 1
    assert (tmp_path / "set-aside" / "u1.1" / "u1.sqlite").read_bytes() == letter


def test_a_full_disk_fails_the_commit_and_loses_nothing_when_there_is_room_again(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with opened(path) as log:
        append(log, arrival(1))
        resource.setrlimit(resource.RLIMIT_FSIZE, (Path(f"{path}-wal").stat().st_size, hard))
        try:
            failed = append(log, *map(arrival, range(2, 100)))
            state = log.state
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        assert all(isinstance(result, LogError) for result in failed)
        assert "can't be" in state.error
        results = append(log, *map(arrival, range(1, 100)))
        assert [result.fresh for result in results if isinstance(result, Committed)] == [False] + [True] * 98
        assert [sweep.sequence for sweep in read(log)] == list(range(1, 100))
        assert log.state.error == ""


def test_a_file_of_a_later_gateway_is_not_touched(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with sqlite3.connect(path) as db:
        db.execute("PRAGMA user_version = 99")
    before = path.read_bytes()
    with pytest.raises(LogError, match="schema 99"):
        LogFile(path, elapsed.now())
    with opened(path) as log:
        assert "has schema 99, this gateway knows 3; run its own version" in log.state.error
    assert path.read_bytes() == before


def test_a_log_that_can_not_be_opened_answers_no_reader_that_it_is_empty(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, *map(arrival, range(3)))
    head = tmp_path / "u1.sqlite-head"
    head.rename(tmp_path / "kept")
    head.mkdir()
    with opened(path) as log:
        with pytest.raises(LogError, match=r"u1.sqlite can't be opened: .*Is a directory"):
            read(log)
        head.rmdir()
        (tmp_path / "kept").rename(head)
        append(log, arrival(3))
        assert [sweep.sequence for sweep in read(log)] == [0, 1, 2, 3]


@pytest.mark.parametrize("moved", [("",), ("", "-head")])
def test_the_log_of_another_unit_is_refused_in_words_and_not_gone_on_with(
    tmp_path: Path, moved: tuple[str, ...]
) -> None:
    for unit in ("u1", "u2"):
        with opened(tmp_path / f"{unit}.sqlite") as log:
            append(log, *(arrival(number, unit=unit) for number in range(3)))
    for suffix in moved:
        (tmp_path / f"u2.sqlite{suffix}").replace(tmp_path / f"u1.sqlite{suffix}")
    before = (tmp_path / "u1.sqlite").read_bytes()
    with opened(tmp_path / "u1.sqlite") as log:
        (result,) = append(log, arrival(3))
        assert isinstance(result, LogError)
        assert "holds sweeps of unit 'u2': stop the gateway and put all files of unit 'u1' back" in log.state.error
        with pytest.raises(LogError, match="of unit 'u2'"):
            read(log)
    assert (tmp_path / "u1.sqlite").read_bytes() == before
    (look,) = (each for each in look_at_all(tmp_path) if each.unit == "u1")
    assert (look.trouble, look.strangers, look.is_sound) == ("", ("u2",), False)
    assert str(look).endswith("; it holds sweeps of u2")
    assert not any(
        each.set_aside for each in repair(tmp_path, []) if each.unit == "u1"
    )  # they may be all that there is of u2's


def test_a_log_that_is_exchanged_for_another_units_is_not_read_as_this_ones(tmp_path: Path) -> None:
    for unit in ("u1", "u2"):
        with opened(tmp_path / f"{unit}.sqlite") as log:
            append(log, *(arrival(number, unit=unit) for number in range(3)))
    with opened(tmp_path / "u1.sqlite") as log:
        append(log, arrival(3))
        for suffix in ("", "-head"):
            (tmp_path / f"u2.sqlite{suffix}").replace(tmp_path / f"u1.sqlite{suffix}")
        (failed,) = append(log, arrival(4))
        assert isinstance(failed, LogError)
        with pytest.raises(LogError):
            read(log)


@pytest.mark.parametrize(
    "removed", [["u1.sqlite"], ["u1.sqlite-wal"], ["u1.sqlite", "u1.sqlite-wal", "u1.sqlite-shm"]], ids=" ".join
)
def test_nothing_is_acknowledged_that_went_into_a_deleted_file(tmp_path: Path, removed: list[str]) -> None:
    path = tmp_path / "u1.sqlite"
    with opened(path) as log:
        append(log, arrival(1))
        for name in removed:
            (tmp_path / name).unlink()
        (failed,) = append(log, arrival(2))
        assert isinstance(failed, LogError)
        assert "deleted or replaced under the running gateway" in str(failed)
        assert str(failed) == log.state.error
        (result,) = append(log, arrival(2))
        assert isinstance(result, Committed)
        assert log.state.error == ""
        assert 2 in {sweep.sequence for sweep in read(log)}
        assert path.exists()


def test_a_log_whose_file_was_replaced_goes_on_in_the_new_file_and_the_moved_one_is_whole(tmp_path: Path) -> None:
    path, other, aside = (tmp_path / name / "u1.sqlite" for name in ("data", "backup", "aside"))
    for each in (path, other, aside):
        each.parent.mkdir()
    with opened(other) as log:
        append(log, *map(arrival, range(10, 15)))
        copied = log.state.log_id
    with opened(path) as log:
        append(log, *map(arrival, range(3)))
        path.rename(aside)
        other.rename(path)
        (failed,) = append(log, arrival(4))
        assert isinstance(failed, LogError)
        (result,) = append(log, arrival(4))
        assert isinstance(result, Committed)
        # Nobody knows which sequences the copied log has used elsewhere since.
        assert result.log_sequence == 6
        assert log.state.log_id != copied
        assert [sweep.sequence for sweep in read(log)] == [*range(10, 15), 4]
    with opened(aside) as log:
        assert [sweep.sequence for sweep in read(log)] == [0, 1, 2]


def test_a_log_whose_folder_was_deleted_goes_on_when_there_is_one_again(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    with opened(folder / "u1.sqlite") as log:
        append(log, arrival(1))
        shutil.rmtree(folder)
        for _ in range(2):
            (failed,) = append(log, arrival(2))
            assert isinstance(failed, LogError)
        assert "see that the folder is there" in log.state.error
        folder.mkdir()
        (result,) = append(log, arrival(2))
        assert isinstance(result, Committed)
        assert len(read(log)) == 1


WRITER = """
import sys
from concurrent.futures import Future
from pathlib import Path
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.log.log_file import Retention
from gateway.test_sweep_log import arrival
log = SweepLog(Path(sys.argv[1]), Retention())
sequence = 0
while True:
    futures = [Future() for _ in range(5)]
    for future in futures:
        log.append(arrival(sequence), future.set_result)
        sequence += 1
    for future in futures:
        print(future.result().log_sequence, flush=True)
"""


def test_what_was_acknowledged_is_there_after_a_kill_in_the_middle_of_writing(tmp_path: Path) -> None:
    path = tmp_path / "u1.sqlite"
    for _ in range(3):
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)],
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[1])},
        )
        assert writer.stdout is not None
        acknowledged = [int(writer.stdout.readline()) for _ in range(100)]
        writer.send_signal(signal.SIGKILL)
        acknowledged += map(int, writer.stdout.read().split())
        writer.wait()
        with opened(path, now=elapsed.now) as log:
            held = [sweep.log_sequence for sweep in read(log)]
            assert held == list(range(1, log.state.head + 1))
            assert set(acknowledged) <= set(held)
            assert log.state.size_bytes == sum(map(len, log.read(1, 10_000, 2**30).records))
