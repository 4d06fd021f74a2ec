"""`make bench`: what the parts can do, measured in this run, most of it beside other software. Nothing is passed or
failed here. `PYTHONPATH=tests python tests/bench/run.py scale` runs what wants the whole machine: a large fleet.
"""

import argparse
import sys
from collections.abc import Callable, Sequence

from bench import belief, fleet, idle_relay, large_map, live, loading, neighbours, range_grid, shapes, simulator
from bench.scale import report


def _numbers() -> list[str]:
    rows = [
        ("one simulated unit, sweeping and acknowledged, against real time", simulator.speed(1, 3600.0)),
        ("20 simulated units in one process, against real time", simulator.speed(20, 180.0)),
        ("a sweep's cost on a map of 12 rooms, against a map of one", large_map.cost_growth(12)),
    ]
    return [f"{number:12.2f} {what}" for what, number in rows + large_map.fit_rows(64)]


def _live() -> list[str]:
    return [f"{number:12.2f} {what}" for what, number in live.rows()]


def _loading() -> list[str]:
    return [f"{number:12.1f} {what}" for what, number in loading.rows()]


SECTIONS: Sequence[tuple[str, Callable[[], list[str]]]] = (
    ("Simulator and map", _numbers),
    ("300 simulated units at real time on one core, their far ends on another, over TCP", fleet.table),
    ("The grid beside MRPT's COccupancyGridMap2D with CObservationRange, one core", range_grid.table),
    ("Fusion of one cell", belief.table),
    ("Lines and circles in feature points, ten walks through the paper's room: time, mean error", shapes.table),
    ("The live mapper after a long history", _live),
    ("The relay while nobody draws or watches", idle_relay.table),
    ("From a healthy unit to a reader's store, beside sick neighbours", neighbours.table),
    ("From a command to its answer, processor time", _loading),
)


def main() -> None:
    if sys.argv[1:2] == ["scale"]:
        report.main(sys.argv[2:])
        return
    argparse.ArgumentParser(description=__doc__).parse_args()  # it takes no other word, and --help runs nothing
    for title, table in SECTIONS:
        print(title, flush=True)
        for line in table():
            print(line, flush=True)
        print()


if __name__ == "__main__":
    main()
