"""The thread that owns the map: what its states rest on, how often they come, and what it does about faults."""

import queue
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from time import monotonic

import numpy as np
import pytest
from system.processes import wait_until

from mapper import room
from noctule_mapper.live_config import LiveConfig, Pace
from noctule_mapper.map_worker import MapState, MapWorker
from noctule_mapper.sweep import SweepReadings

PATIENCE_S = 30.0


class Watched:
    """A worker and the states that it has shown."""

    def __init__(self, pace: Pace, next_version: Callable[[], int]) -> None:
        self.states: queue.Queue[MapState] = queue.Queue()
        config = LiveConfig(pace=pace)
        self.worker = MapWorker(config, "paper-room", "mapper", next_version, self.states.put)
        self.worker.start()

    def state_of(self, sweeps: int) -> MapState:
        """The first state that rests on that many sweeps."""
        while (state := self.states.get(timeout=PATIENCE_S)).contour.sweeps != sweeps:
            pass
        return state


@pytest.fixture
def watch() -> Iterator[Callable[..., Watched]]:
    """Makes workers, and ends them."""
    made: list[Watched] = []

    def make(pace: Pace | None = None, next_version: Callable[[], int] | None = None) -> Watched:
        versions = count(1)
        made.append(Watched(pace or Pace(shortest_interval_s=0.0), next_version or (lambda: next(versions))))
        return made[-1]

    yield make
    for each in made:
        each.worker.close()


@pytest.fixture(scope="module")
def survey() -> list[SweepReadings]:
    return room.survey(room.paper_room(), room.paper_path(), np.random.default_rng(7))


def test_a_state_holds_the_time_of_its_newest_sweep_and_the_tiles_that_changed(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched = watch()
    watched.worker.take((), survey[:20])
    first = watched.state_of(20)
    assert first.contour.time.ToNanoseconds() == round(survey[19].time_s * 1e9)
    assert first.features.version == first.contour.version
    watched.worker.take((), survey[20:21])
    second = watched.state_of(21)
    assert second.contour.version > first.contour.version
    assert 0 < len(second.tiles) < len(first.tiles)


def test_sweeps_that_are_taken_off_are_no_longer_part_of_the_map(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched = watch()
    watched.worker.take((), survey[:20])
    watched.worker.take([sweep.identity for sweep in survey[:5]], survey[20:22])
    assert watched.state_of(17).contour.sweeps == 17


def test_contours_come_no_faster_than_the_pace_allows(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    interval_s = 0.4
    watched = watch(Pace(shortest_interval_s=interval_s))
    began_s = monotonic()
    for sweep in survey[:30]:
        watched.worker.take((), [sweep])
        wait_until(lambda: watched.worker.counters()["changes_waiting"] == 0, "the worker does not take", PATIENCE_S)
    watched.state_of(30)
    took_s = monotonic() - began_s
    assert watched.worker.counters()["contours"] <= 1 + took_s / interval_s


def test_a_fit_takes_no_more_than_its_share_of_time(watch: Callable[..., Watched], survey: list[SweepReadings]) -> None:
    watched = watch(Pace(shortest_interval_s=0.0, most_time_share=0.05))
    watched.worker.take((), survey[:30])
    watched.state_of(30)
    began_s = monotonic()
    fit_s = watched.worker.counters()["contour_fit_ms"] / 1e3
    watched.worker.take((), survey[30:31])
    watched.state_of(31)
    assert monotonic() - began_s >= fit_s / 0.05 - 2 * fit_s


def test_a_fit_that_fails_is_counted_and_made_up_for_by_the_next(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    outcomes = iter([OSError("the disk is full"), 2])

    def next_version() -> int:
        outcome = next(outcomes)
        if isinstance(outcome, OSError):
            raise outcome
        return outcome

    watched = watch(next_version=next_version)
    watched.worker.take((), survey[:3])
    wait_until(lambda: watched.worker.counters()["contour_failures"] == 1, "no failure is counted", PATIENCE_S)
    watched.worker.take((), survey[3:4])
    assert watched.state_of(4).contour.version == 2
    watched.worker.check()


def test_what_breaks_the_map_is_raised_where_the_worker_is_watched(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    watched = watch()
    broken = replace(survey[0], range_m=survey[0].range_m[:3])
    watched.worker.take((), [broken])

    def has_raised() -> bool:
        try:
            watched.worker.check()
        except (ValueError, IndexError):
            return True
        return False

    wait_until(has_raised, "nothing is raised", PATIENCE_S)
