"""The process of a map: it holds the map, fits it, and sends what it finds to the mapper's service."""

import os
import queue
import resource
import threading
from multiprocessing.connection import Connection
from pathlib import Path
from time import process_time, sleep
from typing import NoReturn

from noctule.threads import end_process_when_one_fails
from noctule_mapper.live.fit_turn import FitTurn, FreeTurn
from noctule_mapper.live.map_messages import (
    Beat,
    Broke,
    Changed,
    MapSettings,
    MapState,
    PackedState,
    Shown,
    Trouble,
    as_message,
)
from noctule_mapper.live.map_worker import MapWorker
from noctule_mapper.readings.sweep import SweepReadings

_BEAT_S = 1.0
_LOWER = 10  # nice: weighs 110 against 1,024 of a process at 0 (sched_prio_to_weight)


def run_map(connection: Connection) -> NoReturn:
    """Keep a map as the service at the other end of ``connection`` says, until that end is closed."""
    end_process_when_one_fails()
    service = _Service(connection)
    # Before the map: where its kernels are not compiled yet, that takes long.
    threading.Thread(target=service.beat, name="map-beat", daemon=True).start()
    settings = service.receive()
    assert isinstance(settings, MapSettings)
    if settings.fit_turn:
        os.nice(_LOWER)  # one of many sites: sweeps of all go into the stores, and sites change hands, before it fits
    turn = FitTurn(settings.fit_turn) if settings.fit_turn else FreeTurn()
    worker = MapWorker(settings.config, settings.site, settings.service, service.show, service.set_aside, service, turn)
    while True:
        match service.receive():
            case Changed(left, entered, since_s):
                worker.take(left, entered, since_s)
                if service.worker is None:  # what the map begins with is there
                    worker.start()
                    service.worker = worker
            case Shown() as shown:
                service.shown.put(shown)


class _Service:
    """The service, as its map's process sees it. This process ends when the service is gone."""

    def __init__(self, connection: Connection) -> None:
        self.shown: queue.SimpleQueue[Shown] = queue.SimpleQueue()
        self.worker: MapWorker | None = None
        self._connection, self._sending = connection, threading.Lock()

    def receive(self) -> object:
        """The next message."""
        try:
            return self._connection.recv()
        except (EOFError, OSError):
            os._exit(0)

    def beat(self) -> None:
        """Send the map's figures and whether it makes progress, for ever. Raises what has ended the worker."""
        while True:
            if self.worker is None:
                self._send(Beat({}, makes_progress=True))
            else:
                self.worker.check()
                own = {"map_memory_bytes": _resident_bytes(), "map_cpu_ms": round(1e3 * process_time())}
                self._send(Beat(self.worker.counters() | own, self.worker.makes_progress()))
            sleep(_BEAT_S)

    def show(self, state: MapState) -> None:
        """Wait until ``state`` is shown. Raises what the service could not do."""
        self._send(PackedState.of(state))
        if (error := self.shown.get().error) is not None:
            raise error

    def set_aside(self, readings: SweepReadings, error: Exception) -> None:
        """Name a sweep that broke the map."""
        self._send(Broke(readings, as_message(error)))

    def begin(self, kind: str, text: str, error: BaseException | None = None) -> None:
        """As Troubles.begin()."""
        self._send(Trouble(kind, text, over=False, error=as_message(error) if error else None))

    def end(self, kind: str, text: str) -> None:
        """As Troubles.end()."""
        self._send(Trouble(kind, text, over=True))

    def _send(self, message: object) -> None:
        try:
            with self._sending:
                self._connection.send(message)
        except OSError:
            os._exit(0)


def _resident_bytes() -> int:
    """Memory of this process, that which it shares with others too."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()
