"""The service's side of the map's process, and the nursery that forks it: what a restart begins with, and who is
killed.
"""

import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import psutil
import pytest
from system.processes import PATIENCE_S, wait_until

from mapper import room
from noctule_mapper.live import remote_map
from noctule_mapper.live.config import LiveConfig, Pace
from noctule_mapper.live.map_messages import MapSettings, MapState
from noctule_mapper.live.map_process import run_map
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.remote_map import RemoteMap
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.live.troubles import Troubles
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view.no_log import NoLog

SETTINGS = MapSettings(LiveConfig(pace=Pace(shortest_interval_s=0.0)), "paper-room", "mapper")

_FAILS = """
import os, signal
from noctule_mapper.live.nursery import Nursery

def serve(connection):
    raise ValueError("no map today")

nursery = Nursery(serve, log_prefix="attic: ")
nursery.begin()
print(nursery.ended())
os.kill(nursery._pid, signal.SIGKILL)
os.waitid(os.P_PID, nursery._pid, os.WEXITED | os.WNOWAIT)
try:
    nursery.begin()
except RuntimeError as error:
    print(error)
"""


class Watched:
    """A map in a process of its own, and what it shows: each state with the troubles that stood then."""

    def __init__(self, held: Callable[["Watched"], Sequence[SweepReadings]]) -> None:
        self.troubles = Troubles(NoLog().show_event)
        self.shown: queue.Queue[tuple[MapState, str]] = queue.Queue()
        self._nursery = Nursery(run_map)
        self.map = RemoteMap(self._nursery, SETTINGS, lambda: held(self), self._show, lambda *_: None, self.troubles)

    def process(self) -> psutil.Process:
        """The map's."""
        own = psutil.Process(self._nursery._pid)
        return wait_until(lambda: next(iter(own.children()), None), "there is no map's process")

    def _show(self, state: MapState) -> None:
        self.shown.put((state, self.troubles.detail()))


@pytest.fixture
def survey() -> list[SweepReadings]:
    return room.survey(room.paper_room(), room.paper_path(), np.random.default_rng(7))[:10]


@pytest.fixture
def watch() -> Iterator[Callable[..., Watched]]:
    """Makes maps, and ends their processes."""
    made: list[Watched] = []

    def make(held: Callable[[Watched], Sequence[SweepReadings]] = lambda _: []) -> Watched:
        made.append(Watched(held))
        return made[-1]

    yield make
    for each in made:
        each.map.close()


def test_a_restarted_map_has_each_change_that_was_taken_while_the_store_was_read_and_waits_for_a_store(
    watch: Callable[..., Watched], survey: list[SweepReadings]
) -> None:
    errors = iter([StoreError("the disk is gone")])
    told = list[str]()

    def held(watched: Watched) -> Sequence[SweepReadings]:
        told.append(watched.troubles.detail())
        for error in errors:
            raise error
        # Two changes that the store does not have yet, of which the second undoes a part of the first, and one that
        # it has.
        watched.map.take([survey[0].identity], [survey[6]])
        watched.map.take([survey[6].identity, survey[7].identity], [survey[8]])
        watched.map.take((), [survey[5]])
        return [*survey[:6], survey[6], survey[7]]

    watched = watch(held)
    watched.map.start(survey[:3])
    watched.shown.get(timeout=PATIENCE_S)
    watched.process().kill()
    state, trouble = watched.shown.get(timeout=PATIENCE_S)
    assert state.contour.sweeps == 6  # 1 to 5, and 8
    assert told[0].startswith("the map's process ended with -9")
    assert told[1] == "the disk is gone; the map's process starts again when it can be read"
    assert trouble == told[1]  # until the contour is there
    wait_until(lambda: watched.troubles.detail() == "", "the status still says it")


def test_a_process_is_killed_for_its_silence_and_not_for_a_pause_of_all(
    watch: Callable[..., Watched], survey: list[SweepReadings], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote_map, "_SILENT_AFTER", 3)
    watched = watch()
    watched.map.start(survey[:3])
    watched.shown.get(timeout=PATIENCE_S)
    process = watched.process()
    process.suspend()
    time.sleep(4.0)  # the pause: nobody looks, and all that was sent is received
    for _ in range(3):
        watched.map.watch()
    assert process.status() == psutil.STATUS_STOPPED
    wait_until(lambda: watched.map.watch() or "ended with -9" in watched.troubles.detail(), "it is not killed")


def test_a_state_that_is_on_its_way_for_ten_minutes_is_no_progress_and_nobody_is_killed_for_it(
    watch: Callable[..., Watched], survey: list[SweepReadings], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remote_map, "_SILENT_AFTER", 3)
    watched, goes_on = watch(), queue.Queue[None]()
    monkeypatch.setattr(watched.map, "_show", lambda _: goes_on.get())
    watched.map.start(survey[:3])
    wait_until(lambda: watched.map._shows, "nothing is shown")
    for _ in range(600):
        watched.map.watch()
    assert watched.map.makes_progress
    watched.map.watch()
    assert not watched.map.makes_progress
    goes_on.put(None)
    wait_until(lambda: not watched.map._shows, "it does not go on")
    watched.map.watch()
    assert watched.map.makes_progress
    assert watched.map.counters()["map_restarts"] == 0


def test_the_pid_of_a_process_that_has_ended_is_its_own_until_the_next_one_begins() -> None:
    nursery = Nursery(lambda connection: os.kill(os.getpid(), connection.recv()))
    try:
        connection, pid = nursery.begin()
        connection.send(signal.SIGTERM)  # of no effect: it is for the mapper alone
        assert nursery.ended() == 0
        assert psutil.Process(pid).status() == psutil.STATUS_ZOMBIE
        connection, _ = nursery.begin()
        assert not psutil.pid_exists(pid)
        connection.send(signal.SIGKILL)
        assert nursery.ended() == -signal.SIGKILL
    finally:
        nursery.close()


def test_what_a_process_of_the_map_fails_with_is_in_the_log_and_a_nursery_that_is_gone_is_named() -> None:
    done = subprocess.run([sys.executable, "-c", _FAILS], check=True, capture_output=True, text=True)
    assert done.stdout.splitlines() == ["70", "the process that the map's is forked from is gone"]
    assert "attic: a process of the map has failed" in done.stderr
    assert done.stderr.rstrip().endswith("ValueError: no map today")


def test_what_fails_because_it_is_closed_under_a_state_that_is_being_shown_fails_nobody(
    watch: Callable[..., Watched], survey: list[SweepReadings], monkeypatch: pytest.MonkeyPatch
) -> None:
    watched, closed, failed = watch(), threading.Event(), list[object]()

    def show(_: MapState) -> None:
        closed.wait()
        raise RuntimeError("the session is closed")

    monkeypatch.setattr(watched.map, "_show", show)
    monkeypatch.setattr(threading, "excepthook", failed.append)  # where a mapper would end with 70
    watched.map.start(survey[:3])
    wait_until(lambda: watched.map._shows, "nothing is shown")
    watched.map.close()
    closed.set()
    watched.map._thread.join(PATIENCE_S)
    assert not watched.map._thread.is_alive()
    assert not failed
