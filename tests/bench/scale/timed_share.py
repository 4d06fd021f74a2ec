"""``noctule-mapper share`` whose sites' mappers note when each sweep is in the store, or superseded by one that is,
and in the contour.

Each process writes a file into the folder that BENCH_TIMES names, SITE.PID, with a line for each sweep:
``s DELIVERED_NS UNIT LOG_SEQUENCE START_NS``, and ``c SHOWN_NS START_NS`` when it is in a published contour. A
contour with sweeps is ``p SHOWN_NS``; the first may be the last one of the mapper before.
"""

import os
import threading
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TextIO

from noctule import logs
from noctule.messages_pb2 import Contour, Features, GridTile, Sweep
from noctule_mapper.cli import app
from noctule_mapper.live.intake import SweepIntake
from noctule_mapper.live.publish import MapPublisher
from noctule_mapper.live.service import LiveSettings
from noctule_mapper.sharing import site_process

_map_site = site_process.map_site


def timed_map_site(settings: LiveSettings, log_format: logs.LogFormat, heartbeat: str) -> None:
    """Map a site, and write the times down."""
    place = Path(os.environ["BENCH_TIMES"]) / f"{settings.site}.{os.getpid()}"
    with place.open("w", buffering=1) as file:
        _note_times(file)
        _map_site(settings, log_format, heartbeat)


def _note_times(file: TextIO) -> None:
    deliver, publish, publish_contour = SweepIntake.deliver, MapPublisher.publish_map, MapPublisher.publish_contour
    lock, waiting = threading.Lock(), set[int]()  # starts of sweeps that no contour rests on yet

    def timed_deliver(self: SweepIntake, sweeps: Sequence[Sweep]) -> None:
        deliver(self, sweeps)
        now_ns = time.time_ns()
        starts = [sweep.start.ToNanoseconds() for sweep in sweeps]
        with lock:
            waiting.update(starts)
        file.write(
            "".join(
                f"s {now_ns} {sweep.unit} {sweep.log_sequence} {start}\n"
                for sweep, start in zip(sweeps, starts, strict=True)
            )
        )

    def timed_publish(
        self: MapPublisher, contour: Contour, features: Features, changed_tiles: Iterable[GridTile]
    ) -> None:
        publish(self, contour, features, changed_tiles)
        now_ns, newest = time.time_ns(), contour.time.ToNanoseconds()
        with lock:
            shown = {start for start in waiting if start <= newest}
            waiting.difference_update(shown)
        file.write("".join(f"c {now_ns} {start}\n" for start in shown))

    def timed_contour(self: MapPublisher, contour: Contour) -> None:
        publish_contour(self, contour)
        if contour.sweeps:
            file.write(f"p {time.time_ns()}\n")

    SweepIntake.deliver, MapPublisher.publish_map = timed_deliver, timed_publish
    MapPublisher.publish_contour = timed_contour


if __name__ == "__main__":
    site_process.map_site = timed_map_site
    app()
