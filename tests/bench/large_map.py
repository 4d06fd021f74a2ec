"""What a sweep costs on a large map, against a small one."""

import time
from dataclasses import replace

import numpy as np
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.mapper import Mapper


def cost_growth(rooms: int) -> float:
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
