"""What a sweep and a contour cost on a large map, against a small one."""

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
from mapper.room import paper_path, paper_room, survey

from noctule_mapper.mapper import Mapper
from noctule_mapper.readings.sweep import SweepReadings

_APART_M = 5.0  # from one room to the next


def cost_growth(rooms: int) -> float:
    """Median cost of a sweep in the last of ``rooms`` rooms side by side, against the first."""
    mapper, medians_s = Mapper(), []
    for room in range(rooms):
        costs_s = [_seconds(lambda one=one: mapper.register_sweep(one)) for one in _swept(room)]
        medians_s.append(float(np.median(costs_s)))
    return medians_s[-1] / medians_s[0]


def fit_rows(rooms: int) -> list[tuple[str, float]]:
    """What the contour of ``rooms`` rooms costs against that of each of them alone, and when one sweep more is in."""
    _map_of([0]).contour()  # loads what a first contour loads
    alone, together = [_map_of([room]) for room in range(rooms)], _map_of(range(rooms))
    # Half of the rooms before and half after, so that a machine that grows slower or faster counts little.
    before_s = [_seconds(mapper.contour) for mapper in alone[::2]]
    all_s = _seconds(together.contour)
    alone_s = before_s + [_seconds(mapper.contour) for mapper in alone[1::2]]
    together.register_sweep(replace(next(_swept(0)), identity=("one more", 1)))
    more_s, mean_s = _seconds(together.contour), sum(alone_s) / rooms
    return [
        (f"the contour of {rooms} rooms, against the sum of each room's alone", all_s / sum(alone_s)),
        ("the same, against so many times the first room's", all_s / (rooms * alone_s[0])),
        (f"the contour after one sweep more there, against a room's, {1e3 * mean_s:.0f} ms", more_s / mean_s),
    ]


def _map_of(rooms: Iterable[int]) -> Mapper:
    mapper = Mapper()
    for room in rooms:
        for sweep in _swept(room):
            mapper.register_sweep(sweep)
    return mapper


def _swept(room: int) -> Iterator[SweepReadings]:
    for sweep in survey(paper_room(), paper_path(), np.random.default_rng(11 + room)):
        yield replace(sweep, identity=(f"room {room}", sweep.identity[1]), x_m=sweep.x_m + _APART_M * room)


def _seconds(work: Callable[[], object]) -> float:
    began_s = time.process_time()
    work()
    return time.process_time() - began_s
