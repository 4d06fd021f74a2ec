"""A site for tests of the live mapper: a router, a replayed survey of the paper's room, and mappers as processes."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zenoh
from system.processes import Programs, free_ports, programs, wait_until

from mapper import room
from noctule import bus
from noctule.client import Client
from noctule.messages_pb2 import Contour, Pose, Reading, Sensor, Sweep
from noctule.replay import Replay
from noctule_mapper.readings.sweep import SweepReadings, speed_of_sound_m_s

SITE = "paper-room"
AIR_TEMPERATURE_C = 21.0


def paper_survey() -> list[Sweep]:
    """A survey of the paper's room from its 44 poses, as a gateway would have logged it."""
    rng = np.random.default_rng(7)
    return [message(readings) for readings in room.survey(room.paper_room(), room.paper_path(), rng)]


def message(readings: SweepReadings) -> Sweep:
    """Readings as the message that they came from, from a sensor without bias."""
    sweep = Sweep(
        site=SITE,
        unit=readings.unit,
        sequence=readings.identity[1],
        pose=Pose(x_m=readings.x_m, y_m=readings.y_m, heading_rad=readings.heading_rad),
        air_temperature_c=AIR_TEMPERATURE_C,
        sensor=Sensor(beam_width_rad=readings.beam_width_rad, range_bias_m=0.0, range_sigma_m=readings.range_sigma_m),
    )
    sweep.start.FromNanoseconds(round(readings.time_s * 1e9))
    for bearing_rad, range_m in zip(readings.bearing_rad, readings.range_m, strict=True):
        reading = Reading(bearing_rad=bearing_rad)
        if not math.isnan(range_m):
            reading.time_of_flight_s = 2 * range_m / speed_of_sound_m_s(AIR_TEMPERATURE_C)
        sweep.readings.append(reading)
    return sweep


@dataclass(frozen=True)
class LiveSite:
    """A site on the bus: who replays sweeps on it, who looks at it, and the mappers that run."""

    folder: Path
    endpoint: str
    replay: Replay
    client: Client
    running: Programs

    def play(self, sweeps: Sequence[Sweep]) -> None:
        """Have the site's units make these sweeps now."""
        self.replay.run(sweeps, speed=None)

    def start_mapper(self, *options: str, rerun: str = "none") -> None:
        """Start a mapper on this site's store, drawing on the relay ``rerun``."""
        where = ("--site", SITE, "--data", str(self.folder), "--connect", self.endpoint)
        self.running.start("mapper", "noctule-mapper", "run", *where, "--rerun", rerun, *options)

    def contour_of(self, sweeps: int) -> Contour:
        """The site's contour once it rests on that many sweeps, as one who joins late gets it."""

        def newest() -> Contour | None:
            self.running.check()
            contour = self.client.contour()
            return contour if contour is not None and contour.sweeps == sweeps else None

        contour = wait_until(newest, f"no contour of {sweeps} sweeps")
        assert contour is not None
        return contour


@contextmanager
def live_site(folder: Path) -> Iterator[LiveSite]:
    """A site without a mapper yet; nothing of it is left at the end."""
    (port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{port}"
    router: zenoh.Session = bus.open_session(listen=[endpoint])
    replay = Replay(router, SITE)
    try:
        with Client(SITE, session=router) as client, programs(folder) as running:
            yield LiveSite(folder, endpoint, replay, client, running)
    finally:
        replay.close()
        router.close()
