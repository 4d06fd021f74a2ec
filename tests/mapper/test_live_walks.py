"""What a live map makes of units that walk and stand: things that move, rooms that two units share."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mapper.live_worker import Watched, walk

from mapper import room
from noctule.messages_pb2 import Contour, Sweep
from noctule_mapper.config import Window
from noctule_mapper.live.config import Pace
from noctule_mapper.live.store import SweepStore
from noctule_mapper.readings.sweep import from_message

NEAR_M = 0.02  # a cylinder is where it was put: ten of a fit's errors in the paper's room
CARRIED_TO = (0.30, 0.35, 0.448)  # from (1.384, 0.480), on the other side of the room


class LiveMap:
    """A store and a worker that take sweeps as the live mapper does."""

    def __init__(self, folder: Path, window: Window, watched: Watched) -> None:
        self._store = SweepStore(folder / "site.sqlite3", window)
        self._watched = watched

    def take(self, *sweeps: Sweep) -> Contour:
        """Deliver sweeps; the contour once it rests on all of the window."""
        change = self._store.commit(sweeps, [])
        self._watched.worker.take(change.left, [from_message(sweep) for sweep in change.entered])
        held = self._store.sweeps()
        newest = max(sweep.start.ToNanoseconds() for sweep in held)

        def is_it(contour: Contour) -> bool:
            return contour.sweeps == len(held) and contour.time.ToNanoseconds() == newest

        return self._watched.state_when(is_it).contour

    def close(self) -> None:
        self._store.close()


@pytest.fixture
def live_map(tmp_path: Path) -> Iterator[Callable[..., LiveMap]]:
    """Makes maps with a store, and closes it."""
    made: list[LiveMap] = []

    def make(window: Window | None = None) -> LiveMap:
        made.append(LiveMap(tmp_path, window or Window(), Watched(Pace(shortest_interval_s=0.0), None)))
        return made[-1]

    yield make
    for each in made:
        each.close()


def cylinders_at(contour: Contour, *places: tuple[float, float, float]) -> list[bool]:
    """For each place whether a cylinder stands there; fails if one stands anywhere else."""
    found = np.array([(one.x_m, one.y_m, one.radius_m) for one in contour.cylinders]).reshape(-1, 1, 3)
    there = np.abs(found - np.array(places)).max(axis=2) < NEAR_M
    assert there.any(axis=1).all(), contour.cylinders
    return list(there.any(axis=0))


@pytest.mark.parametrize("noise_m", [0.0, 0.004])
def test_a_cylinder_carried_elsewhere_moves_on_the_map_within_one_round_of_the_path(
    live_map: Callable[..., LiveMap], noise_m: float
) -> None:
    rng = np.random.default_rng(301)
    before, poses = room.paper_room(), room.paper_path()
    after = replace(before, cylinders=(CARRIED_TO,))
    old, new = before.cylinders[0], CARRIED_TO
    site, half = live_map(), len(poses) // 2
    assert cylinders_at(site.take(*walk(before, poses, 1, rng, noise_m)), old, new) == [True, False]
    second = walk(after, poses, 1 + len(poses), rng, noise_m)
    halfway = site.take(*second[:half])
    assert len(halfway.walls) >= 5
    assert cylinders_at(halfway, old, new)[1]
    contour = site.take(*second[half:])
    assert contour.sweeps == len(poses)
    assert len(contour.walls) >= 5
    assert cylinders_at(contour, old, new) == [False, True]


def test_two_units_that_walk_half_the_room_each_make_one_map_of_it(live_map: Callable[..., LiveMap]) -> None:
    rng = np.random.default_rng(302)
    place, (first_half, second_half) = room.paper_room(), np.array_split(room.paper_path(), 2)
    site = live_map()
    late = walk(place, second_half, 1, rng, unit="u2")  # its link was down
    early = site.take(*walk(place, first_half, 1, rng, unit="u1"))
    assert len(early.corners) < 5
    contour = site.take(*late)
    assert (len(contour.walls), len(contour.corners), len(contour.cylinders)) == (5, 5, 1)
    assert contour.time.ToNanoseconds() == early.time.ToNanoseconds()
    again = site.take(*walk(place, second_half, 101, rng, unit="u2"))
    assert (again.sweeps, len(again.corners), len(again.cylinders)) == (contour.sweeps, 5, 1)


def test_units_that_stand_still_keep_the_sweeps_of_both_stepper_directions(live_map: Callable[..., LiveMap]) -> None:
    rng = np.random.default_rng(303)
    stands = room.paper_path()[[3, 17, 30]]
    site = live_map(Window(sweeps_per_place=2))
    for number in range(1, 8):
        sweeps = [
            sweep
            for unit, pose in enumerate(stands)
            for sweep in walk(room.paper_room(), pose[None, :], number, rng, 0.004, unit=f"u{unit}")
        ]
        assert site.take(*sweeps).sweeps == min(number, 2) * len(stands)
