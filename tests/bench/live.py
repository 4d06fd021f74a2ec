"""What a sweep costs the live mapper after a long history, and whether the history leaves anything behind.

A unit walks through twelve of the paper's rooms, round after round, with two sweeps at each waypoint: a few more than
the window holds. The sweeps that are timed come one by one, the others in parts, as from a log. Each goes the live
mapper's way from message to store and map; the contour is not fitted.
"""

import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import psutil
from mapper.live_site import message
from mapper.room import paper_path, paper_room, survey

from noctule.messages_pb2 import Cursor, Sweep
from noctule_mapper.live.config import LiveConfig
from noctule_mapper.live.store import SweepStore
from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import from_message

HISTORY = 100_000  # sweeps
TIMED = 1_000
PART = 50  # sweeps that come from a log at once
MARKS = (0.1, 0.5, 1.0)  # of the history, where memory is looked at
ROOMS, ROOM_PITCH_M = 12, 5.0
SWEEPS_PER_WAYPOINT = 2
SWEEP_S = 3.0
POSE_NOISE_M = 0.004
FLIGHT_NOISE_S = 1e-5

Row = tuple[str, float]


@dataclass(frozen=True)
class Costs:
    """Of sweeps that came one by one, (n,): by the clock, and on the processor."""

    wall_ms: np.ndarray
    processor_ms: np.ndarray


class Site:
    """A live mapper's store and map, and the unit that goes round."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / "bench.sqlite3"
        self._sweeps = rounds()
        self.store = SweepStore(self._path, LiveConfig().window)
        self.mapper = Mapper()

    def timed(self, count: int) -> Costs:
        """Take ``count`` sweeps one by one."""
        costs = []
        for sweep in islice(self._sweeps, count):
            began = time.perf_counter(), time.process_time()
            self._take([sweep])
            costs.append((time.perf_counter() - began[0], time.process_time() - began[1]))
        return Costs(*(1e3 * np.array(costs).T))

    def pass_over(self, count: int) -> None:
        """Take ``count`` sweeps as they come from a log."""
        for _ in range(0, count, PART):
            self._take(list(islice(self._sweeps, PART)))
            self.mapper.grid.changed()  # as a program that shows the map asks

    def held_mib(self) -> tuple[float, float]:
        """Memory of this process and size of the store's files."""
        files = sum(file.stat().st_size for file in self._path.parent.iterdir())
        return psutil.Process().memory_info().rss / 2**20, files / 2**20

    def _take(self, sweeps: Sequence[Sweep]) -> None:
        last = sweeps[-1]
        change = self.store.commit(sweeps, [Cursor(unit=last.unit, log_id=last.log_id, log_sequence=last.log_sequence)])
        for identity in change.left:
            self.mapper.remove_sweep(identity)
        for sweep in change.entered:
            self.mapper.register_sweep(from_message(sweep))


def rounds() -> Iterator[Sweep]:
    """The unit's sweeps, each with noise of its own on pose and ranges; they never end."""
    rng = np.random.default_rng(31)
    room = [message(made) for made in survey(paper_room(), paper_path(), rng)]
    number = 0
    while True:
        for x_m in ROOM_PITCH_M * np.arange(ROOMS):
            for made in room:
                for _ in range(SWEEPS_PER_WAYPOINT):
                    number += 1
                    yield _wavering(made, x_m, number, rng)


def _wavering(made: Sweep, x_m: float, number: int, rng: np.random.Generator) -> Sweep:
    sweep = Sweep()
    sweep.CopyFrom(made)
    sweep.log_id, sweep.log_sequence = "bench", number
    sweep.start.FromNanoseconds(int(number * SWEEP_S * 1e9))
    sweep.pose.x_m += x_m + rng.normal(0, POSE_NOISE_M)
    sweep.pose.y_m += rng.normal(0, POSE_NOISE_M)
    for reading, late_s in zip(sweep.readings, rng.normal(0, FLIGHT_NOISE_S, len(sweep.readings)), strict=True):
        if reading.HasField("time_of_flight_s"):
            reading.time_of_flight_s += late_s
    return sweep


def rebuild_s(site: Site) -> float:
    """Seconds to make the map again from the store, as at a start."""
    began_s = time.perf_counter()
    mapper = Mapper()
    for sweep in site.store.sweeps():
        mapper.register_sweep(from_message(sweep))
    return time.perf_counter() - began_s


def rows(history: int = HISTORY) -> list[Row]:
    """What was measured, each with a label; a tenth of ``history`` must be more than fills the window."""
    window = LiveConfig().window.max_sweeps
    with tempfile.TemporaryDirectory() as folder:
        site = Site(Path(folder))
        with closing(site.store):
            site.pass_over(window)
            first, gone, held = site.timed(TIMED), window + TIMED, []
            for mark in MARKS:
                site.pass_over(round(mark * history) - gone)
                gone = round(mark * history)
                held.append((gone, *site.held_mib()))
            last = site.timed(TIMED)
            took_s = rebuild_s(site)
    rebuilt = (f"seconds to rebuild the map of {window:,} sweeps from the store", took_s)
    return [*_cost_rows(first, last, history), *_held_rows(held), rebuilt]


def _cost_rows(first: Costs, last: Costs, history: int) -> list[Row]:
    what = f"a live update of a sweep, {history:,} sweeps before it"
    return [
        (f"{what}: median, ms", float(np.median(last.wall_ms))),
        (f"{what}: p99, ms", float(np.percentile(last.wall_ms, 99))),
        (f"{what}: p99 of its time on the processor, ms", float(np.percentile(last.processor_ms, 99))),
        (f"{what}: p99 against median", float(np.percentile(last.wall_ms, 99) / np.median(last.wall_ms))),
        (
            f"{what}: median against that of the first {TIMED:,} on a full window",
            float(np.median(last.processor_ms) / np.median(first.processor_ms)),
        ),
    ]


def _held_rows(held: Sequence[tuple[int, float, float]]) -> list[Row]:
    return [
        row
        for gone, resident_mib, store_mib in held
        for row in (
            (f"memory of the live mapper after {gone:,} sweeps, MiB", resident_mib),
            ("its store's files then, MiB", store_mib),
        )
    ]


def main() -> None:
    for what, figure in rows():
        print(f"{figure:9.4g}  {what}", flush=True)


if __name__ == "__main__":
    main()
