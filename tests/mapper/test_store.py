"""The mapper's store: nothing twice, nothing lost, nothing beyond the window."""

import math
import resource
import shutil
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mapper.room import paper_path
from mapper.stored_sweeps import LOG, cursor, sequences, sweep
from sdk.host_clocks import Host

from noctule.elapsed import Instant
from noctule.folder_lock import FolderLock, Owner, owner_of
from noctule.messages_pb2 import FAULT_KIND_TURNED, Cursor, LogRecords, Pose, Sweep
from noctule.unit_reader import UnitReader
from noctule_mapper.cli import main
from noctule_mapper.config import Window
from noctule_mapper.live.store import SweepStore
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.readings.faulty import suspects


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


def test_a_unit_that_is_forgotten_is_read_again_from_its_log_and_no_other_is(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Sweeps 3 and 4 of u1 are a stranger's, and its log ends at 3."""
    own = [sweep(number) for number in (1, 2, 3)]
    store = SweepStore(path, Window())
    store.commit([*own[:2], sweep(3, x_m=70.0), sweep(4)], [cursor(4)])
    store.set_aside((LOG, 2), "IndexError: 64")
    store.commit([stop(1, 5.0, unit="u2", log="b")], [Cursor(unit="u2", log_id="b", log_sequence=1)])
    store.close()
    repair = ["repair", str(path.parent), "--site", "paper-room", "--unit"]
    owner = Owner("mapper of several sites", "", "m1")
    with FolderLock(path.parent, owner):
        assert "is in use by mapper of several sites 'm1'" in str(told_by([*repair, "u1"]))
    assert not told_by([*repair, "u1"])
    assert capsys.readouterr().out == "paper-room.sqlite3: 3 sweeps of u1 and its cursor are forgotten\n"
    assert owner_of(path.parent) == owner
    assert "paper-room.sqlite3 holds nothing of unit 'u1'" in str(told_by([*repair, "u1"]))
    assert "holds no store of site yard" in str(told_by([*repair[:3], "yard", "--unit", "u1"]))
    store = SweepStore(path, Window())
    assert ([held.unit for held in store.sweeps()], list(store.cursors())) == (["u2"], ["u2"])

    def deliver(sweeps: Sequence[Sweep]) -> None:
        store.commit(sweeps, [cursor(sweeps[-1].log_sequence)])

    reader = UnitReader("u1", None, deliver, Counter())
    assert not reader.read(LogRecords(log_id=LOG, head=3, tail=1, sweeps=own))
    assert store.sweeps()[1:] == own
    assert store.cursors()["u1"] == cursor(3)
    store.close()


def told_by(arguments: list[str]) -> str | int | None:
    """What the command says at its end, or its exit status."""
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    return ended.value.code


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
