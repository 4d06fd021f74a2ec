"""The mapper's store: nothing twice, nothing lost, nothing beyond the window."""

import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from noctule.messages_pb2 import Cursor, Pose, Sweep
from noctule_mapper.live_config import Window
from noctule_mapper.store import StoreError, SweepStore

LOG = "8c1f"


def sweep(number: int, start_s: float | None = None, x_m: float | None = None) -> Sweep:
    """The ``number``th sweep of a log; by default each from a place of its own, one second apart."""
    message = Sweep(unit="u1", log_id=LOG, log_sequence=number, pose=Pose(x_m=number if x_m is None else x_m))
    message.start.FromNanoseconds(int((number if start_s is None else start_s) * 1e9))
    return message


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


def test_newer_sweeps_from_a_place_supersede_its_older_ones(path: Path) -> None:
    store = SweepStore(path, Window(sweeps_per_place=2))
    store.commit([sweep(1, x_m=0.0), sweep(2, x_m=1.0), sweep(3, x_m=0.0)], [cursor(3)])
    change = store.commit([sweep(4, x_m=0.004)], [cursor(4)])
    assert change.left == ((LOG, 1),)
    assert sequences(store) == [2, 3, 4]
    store.close()


def test_a_sweep_that_comes_too_late_for_the_window_changes_nothing(path: Path) -> None:
    store = SweepStore(path, Window(max_age_s=10))
    store.commit([sweep(2, start_s=100)], [cursor(2)])
    late = store.commit([sweep(1, start_s=1)], [cursor(2)])
    assert late.entered == late.left == ()
    store.close()


def test_a_sweep_from_the_future_does_not_empty_the_window(path: Path) -> None:
    store = SweepStore(path, Window(max_age_s=10), now_ns=lambda: 20 * 10**9)
    store.commit([sweep(15), sweep(16, start_s=1e6), sweep(17)], [cursor(17)])
    assert sequences(store) == [15, 17, 16]
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


def test_a_file_that_is_no_store_is_refused_with_what_to_do(path: Path) -> None:
    path.write_text("a letter to the editor, long enough to be no database " * 40)
    with pytest.raises(StoreError, match=r"paper-room\.sqlite3 can't be used .* move it away"):
        SweepStore(path, Window())


def test_a_store_of_another_format_is_refused(path: Path) -> None:
    with sqlite3.connect(path) as database:
        database.execute("PRAGMA user_version = 9")
    with pytest.raises(StoreError, match="has format 9"):
        SweepStore(path, Window())


WRITER = """
import sys
from pathlib import Path
from noctule.messages_pb2 import Cursor, Pose, Sweep
from noctule_mapper.live_config import Window
from noctule_mapper.store import SweepStore

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
