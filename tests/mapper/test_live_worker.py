"""The thread that owns the map: what its states rest on, how often they come, and what it does about faults."""

import queue
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import monotonic

import numpy as np
import pytest
from mapper.live_worker import Watched, made_worker, walk
from system.processes import PATIENCE_S, wait_until

from mapper import room
from noctule_mapper.config import Window
from noctule_mapper.live.config import Pace
from noctule_mapper.live.fit_turn import FreeTurn
from noctule_mapper.live.map_messages import MapState
from noctule_mapper.live.store import SweepStore
from noctule_mapper.mapper import Mapper
from noctule_mapper.messages import contour_message
from noctule_mapper.readings.sweep import SweepReadings, from_message


@pytest.fixture
def watch() -> Callable[..., Watched]:
    """Makes workers."""

    def make(pace: Pace | None = None, show: Callable[[MapState], None] | None = None) -> Watched:
        return Watched(pace or Pace(shortest_interval_s=0.0), show)

    return make


@pytest.fixture(scope="module")
def survey() -> list[SweepReadings]:
    return room.survey(room.paper_room(), room.paper_path(), np.random.default_rng(7))


def test_rounds_through_two_rooms_leave_no_more_behind_than_the_window_holds(tmp_path: Path) -> None:
    rng = np.random.default_rng(304)
    window, poses = Window(max_sweeps=30), room.paper_path()
    store, mapper = SweepStore(tmp_path / "site.sqlite3", window), Mapper()
    rounds = []
    for number in range(8):
        for sweep in walk(room.paper_room(), poses, 1 + number * len(poses), rng, 0.004):
            sweep.pose.x_m += 10.0 * (number % 2)
            change = store.commit([sweep], [])
            for identity in change.left:
                mapper.remove_sweep(identity)
            for entered in change.entered:
                mapper.register_sweep(from_message(entered))
        tiles, pages = mapper.grid.tiles(), mapper._contacts._pages.values()
        cells = sum(int(np.count_nonzero(tile.occupied + tile.free)) for tile in tiles)
        voters = max(len(page.voters) + len(page.hearers) for page in pages)
        rounds.append((len(store.sweeps()), len(pages), len(tiles), cells, voters))
    store.close()
    assert {(sweeps, pages) for sweeps, pages, *_ in rounds} == {(30, 30)}
    later, first = np.array(rounds[2:]), np.array(rounds[:2]).max(axis=0)
    assert np.all(later.max(axis=0) <= 1.05 * first + 1), rounds


def test_a_state_holds_the_time_of_its_newest_sweep_and_the_tiles_that_changed(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched = watch()
    watched.worker.take((), survey[:20])
    first = watched.state_of(20)
    assert first.contour.time.ToNanoseconds() == round(survey[19].time_s * 1e9)
    assert first.features.time == first.contour.time
    watched.worker.take((), survey[20:21])
    second = watched.state_of(21)
    assert 0 < len(second.tiles) < len(first.tiles)


def test_sweeps_that_are_taken_off_are_no_longer_part_of_the_map(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched = watch()
    watched.worker.take((), survey[:20])
    watched.worker.take([sweep.identity for sweep in survey[:5]], survey[20:22])
    assert watched.state_of(17).contour.sweeps == 17


def test_sweeps_that_leave_before_their_turn_came_are_never_put_on_the_map(survey: list[SweepReadings]) -> None:
    states: queue.Queue[MapState] = queue.Queue()
    worker = made_worker(states.put)
    worker.take((), survey[:20])
    worker.take([sweep.identity for sweep in survey[:15]], survey[20:25])
    assert worker.counters()["sweeps_waiting"] == 10
    worker.start()
    assert states.get(timeout=PATIENCE_S).contour.sweeps == 10


def test_a_backlog_of_many_windows_waits_as_one_window(tmp_path: Path) -> None:
    store = SweepStore(tmp_path / "site.sqlite3", Window(max_sweeps=25))
    worker = made_worker(lambda _: None)
    rng = np.random.default_rng(305)
    for first in range(1, 500, len(room.paper_path())):
        change = store.commit(walk(room.paper_room(), room.paper_path(), first, rng), [])
        worker.take(change.left, [from_message(sweep) for sweep in change.entered])
        assert worker.counters()["sweeps_waiting"] == 25
    store.close()


def test_a_fit_that_waited_for_its_turn_rests_on_the_sweeps_that_came_meanwhile(survey: list[SweepReadings]) -> None:
    waits, has_turn = threading.Event(), threading.Event()
    states: queue.Queue[MapState] = queue.Queue()

    class Turn(FreeTurn):
        def __enter__(self) -> None:
            waits.set()
            assert has_turn.wait(PATIENCE_S)

    worker = made_worker(states.put, turn=Turn())
    worker.take((), survey[:6])
    worker.start()
    assert waits.wait(PATIENCE_S)
    worker.take([survey[0].identity], survey[6:8])
    has_turn.set()
    assert states.get(timeout=PATIENCE_S).contour.sweeps == 7


def test_in_a_pause_sweeps_are_taken_and_none_is_put_on_the_map(survey: list[SweepReadings]) -> None:
    pauses, goes_on = threading.Event(), threading.Event()
    states: queue.Queue[MapState] = queue.Queue()

    class Turn(FreeTurn):
        def wait_out_pause(self) -> None:
            pauses.set()
            assert goes_on.wait(PATIENCE_S)

    worker = made_worker(states.put, turn=Turn())
    worker.start()
    worker.take((), survey[:3])
    assert pauses.wait(PATIENCE_S)
    worker.take((), survey[3:6])
    assert worker.counters()["sweeps_waiting"] == 6
    assert all(worker.makes_progress() for _ in range(1000))  # looks of one second
    goes_on.set()
    assert states.get(timeout=PATIENCE_S).contour.sweeps == 6


def test_the_delay_of_a_contour_begins_when_its_oldest_sweep_came_to_the_service(survey: list[SweepReadings]) -> None:
    worker = made_worker(lambda _: None)
    worker.take((), survey[:3], monotonic() - 1000.0)
    worker.take((), survey[3:6])
    worker.start()
    wait_until(lambda: worker.counters()["contour_delay_ms"] >= 1e6, "the delay is that of a later sweep")


def test_a_worker_that_is_at_one_fit_for_ten_minutes_makes_no_progress(survey: list[SweepReadings]) -> None:
    fits, goes_on = threading.Event(), threading.Event()

    def show(_: MapState) -> None:
        fits.set()
        goes_on.wait()

    worker = made_worker(show)
    worker.start()
    assert all(worker.makes_progress() for _ in range(1000))  # it waits
    worker.take((), survey[:3])
    assert fits.wait(PATIENCE_S)
    looks = [worker.makes_progress() for _ in range(601)]
    assert looks == [True] * 600 + [False]
    goes_on.set()
    wait_until(worker.makes_progress, "it does not go on")


def test_contours_come_no_faster_than_the_pace_allows(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    interval_s = 0.4
    watched = watch(Pace(shortest_interval_s=interval_s))
    began_s = monotonic()
    for sweep in survey[:30]:
        watched.worker.take((), [sweep])
        wait_until(lambda: watched.worker.counters()["sweeps_waiting"] == 0, "the worker does not take", PATIENCE_S)
    watched.state_of(30)
    took_s = monotonic() - began_s
    assert watched.worker.counters()["contours"] <= 1 + took_s / interval_s


def test_a_fit_takes_no_more_than_its_share_of_time(watch: Callable[..., Watched], survey: list[SweepReadings]) -> None:
    shown_s: queue.Queue[float] = queue.Queue()
    watched = watch(Pace(shortest_interval_s=0.0, most_time_share=0.05), lambda _: shown_s.put(monotonic()))
    watched.worker.take((), survey[:30])
    first_s = shown_s.get(timeout=PATIENCE_S)
    fit_s = wait_until(lambda: watched.worker.counters()["contour_fit_ms"], "the fit does not end", PATIENCE_S) / 1e3
    watched.worker.take((), survey[30:31])
    assert shown_s.get(timeout=PATIENCE_S) - first_s >= fit_s / 0.05 - 2 * fit_s


def test_a_fit_that_fails_is_counted_told_once_and_made_up_for_by_the_next(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    errors = iter([OSError("the disk is full"), OSError("the disk is still full")])
    shown: queue.Queue[MapState] = queue.Queue()

    def show(state: MapState) -> None:
        for error in errors:
            raise error
        shown.put(state)

    watched = watch(show=show)
    for failures in (1, 2):
        watched.worker.take((), survey[3 * failures : 3 * failures + 3])
        wait_until(
            lambda n=failures: watched.worker.counters()["contour_failures"] == n, "no failure is counted", PATIENCE_S
        )
    assert "the contour can't be fitted (OSError)" in watched.troubles.detail()
    assert [level for level, _ in watched.events] == ["WARN"]
    watched.worker.take((), survey[:1])
    assert shown.get(timeout=PATIENCE_S).contour.sweeps == 7
    wait_until(lambda: not watched.troubles.detail(), "the trouble is not over", PATIENCE_S)
    assert watched.events[1:] == [("INFO", "the contour is fitted again")]
    watched.worker.check()


def broken(readings: SweepReadings, number: int) -> SweepReadings:
    """A sweep that the map stumbles over: there is no known one, so this one has lost readings since it was made."""
    spoiled = replace(readings, identity=("spoiled", number))
    object.__setattr__(spoiled, "range_m", readings.range_m[:3])
    return spoiled


def test_sweeps_that_break_the_map_are_set_aside_and_leave_nothing_of_themselves(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched, whole = watch(), Mapper()
    for sweep in survey[:12]:
        whole.register_sweep(sweep)
    watched.worker.take((), [*survey[:6], broken(survey[6], 1), *survey[6:9], broken(survey[9], 2), *survey[9:12]])
    state = watched.state_of(12)
    assert watched.set_aside == [("spoiled", 1), ("spoiled", 2)]
    walls = contour_message(whole.contour(), "paper-room").walls
    assert [wall.rho_m for wall in state.contour.walls] == pytest.approx([wall.rho_m for wall in walls])
    watched.worker.take([("spoiled", 1), survey[0].identity], [survey[12]])
    assert len(watched.state_of(12).tiles) > 0
    watched.worker.check()


def test_what_ends_the_worker_is_raised_where_it_is_watched(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    class PanicException(BaseException):  # as pyo3's, which Zenoh raises
        pass

    def show(_: MapState) -> None:
        raise PanicException

    watched = watch(show=show)
    watched.worker.take((), survey[:1])

    def has_raised() -> bool:
        try:
            watched.worker.check()
        except PanicException:
            return True
        return False

    wait_until(has_raised, "nothing is raised", PATIENCE_S)
