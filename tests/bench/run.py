"""`make bench`: what the parts can do, as ratios measured in this run. Nothing is passed or failed here."""

import re
import subprocess
import time
from dataclasses import replace

import numpy as np
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.mapper import Mapper

SIMULATOR = ("noctule-sim", "--acknowledge", "--speed", "max", "--firmware", "firmware/build/noctule.ihx")


def simulator_speed(units: int, duration_s: float) -> float:
    """Simulated seconds, of all units together, per second on one core; every sweep acknowledged, none missed."""
    command = [*SIMULATOR, "--units", str(units), "--duration", str(duration_s)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    missed = sum(map(int, re.findall(r"(\d+) missed", output)))
    found = re.search(r"([\d.]+) times real time", output)
    if found is None or missed:
        raise SystemExit(f"the simulator said:\n{output}")
    return float(found[1])


def cost_on_a_large_map(rooms: int) -> float:
    """Median cost of a sweep in the last of ``rooms`` rooms side by side, against the first."""
    sweeps = survey(paper_room(), paper_path(), np.random.default_rng(11))
    mapper, medians_s = Mapper(), []
    for room in range(rooms):
        costs_s = []
        for sweep in sweeps:
            moved = replace(sweep, identity=(f"room {room}", sweep.identity[1]), x_m=sweep.x_m + 5.0 * room)
            began_s = time.process_time()
            mapper.register_sweep(moved)
            costs_s.append(time.process_time() - began_s)
        medians_s.append(float(np.median(costs_s)))
    return medians_s[-1] / medians_s[0]


def main() -> None:
    rows = [
        ("one simulated unit, sweeping and acknowledged, against real time", simulator_speed(1, 3600.0)),
        ("20 simulated units in one process, against real time", simulator_speed(20, 180.0)),
        ("a sweep's cost on a map of 12 rooms, against a map of one", cost_on_a_large_map(12)),
    ]
    for what, ratio in rows:
        print(f"{ratio:9.1f}  {what}", flush=True)


if __name__ == "__main__":
    main()
