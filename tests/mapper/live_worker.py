"""A worker of the live map for tests, and sweeps of a unit that walks through a room."""

import queue
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mapper.live_site import message
from system.processes import PATIENCE_S

from mapper import room
from noctule.messages_pb2 import Contour, Sweep
from noctule_mapper.live.config import LiveConfig, Pace
from noctule_mapper.live.fit_turn import FreeTurn, Turn
from noctule_mapper.live.map_messages import MapState
from noctule_mapper.live.map_worker import MapWorker
from noctule_mapper.live.troubles import Troubles
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.rerun_view.no_log import NoLog


def made_worker(
    show: Callable[[MapState], None],
    config: LiveConfig | None = None,
    set_aside: Callable[[SweepReadings, Exception], None] = lambda *_: None,
    troubles: Troubles | None = None,
    turn: Turn | None = None,
) -> MapWorker:
    """A worker for the paper's room."""
    told = troubles or Troubles(NoLog().show_event)
    return MapWorker(config or LiveConfig(), "paper-room", "mapper", show, set_aside, told, turn or FreeTurn())


class Watched:
    """A worker and the states that it has shown."""

    def __init__(self, pace: Pace, show: Callable[[MapState], None] | None) -> None:
        self.states: queue.Queue[MapState] = queue.Queue()
        self.set_aside: list[tuple[str, int]] = []
        self.events: list[tuple[str, str]] = []
        self.troubles = Troubles(lambda text, level="INFO": self.events.append((level, text)))
        self.worker = made_worker(
            show or self.states.put,
            LiveConfig(pace=pace),
            lambda readings, _: self.set_aside.append(readings.identity),
            self.troubles,
        )
        self.worker.start()

    def state_of(self, sweeps: int) -> MapState:
        """The first state that rests on that many sweeps."""
        return self.state_when(lambda contour: contour.sweeps == sweeps)

    def state_when(self, is_it: Callable[[Contour], bool]) -> MapState:
        """The first state whose contour is the one."""
        while not is_it((state := self.states.get(timeout=PATIENCE_S)).contour):
            pass
        return state


def walk(
    place: room.Room, poses: np.ndarray, first: int, rng: np.random.Generator, noise_m: float = 0.0, unit: str = "u1"
) -> list[Sweep]:
    """A unit's sweeps from the poses, numbered from ``first``, as a gateway would log them that knows its poses with
    noise.
    """
    sweeps = []
    for number, pose in enumerate(poses, start=first):
        sweep = message(replace(room.sweep_at(place, pose, number, rng), unit=unit))
        sweep.log_id, sweep.log_sequence = f"log of {unit}", number
        sweep.pose.x_m += rng.normal(0, noise_m)
        sweep.pose.y_m += rng.normal(0, noise_m)
        sweep.pose.sigma_position_m = noise_m
        sweeps.append(sweep)
    return sweeps
