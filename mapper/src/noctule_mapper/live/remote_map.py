"""The map as its service sees it: in a process of its own, so that no sweep waits for a fit on its way into the store.

The service's threads hand a sweep on some ten times until it is committed, and where a fit runs in the same process
each of them waits for the interpreter's lock.
"""

import logging
import os
import signal
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from time import monotonic

from noctule_mapper.live.map_messages import (
    Beat,
    Broke,
    Changed,
    MapProcessError,
    MapSettings,
    MapState,
    PackedState,
    Shown,
    Trouble,
)
from noctule_mapper.live.nursery import Nursery
from noctule_mapper.live.rest import Rest
from noctule_mapper.live.store_file import StoreError
from noctule_mapper.live.troubles import Troubles
from noctule_mapper.live.waiting import Waiting
from noctule_mapper.readings.sweep import SweepReadings
from noctule_mapper.window import Identity

_log = logging.getLogger(__name__)
_ENDED = "map process"
_SILENT_AFTER_S = 30.0  # a beat comes each second
_STUCK_AFTER_S = 600.0  # in showing a state, which may wait for the bus
_CLOSE_WITHIN_S = 1.0
_FIGURES = ("contour_fit_ms", "contour_delay_ms", "sweeps_waiting", "map_memory_bytes")


class RemoteMap:
    """Sweeps in, map states out, as with a MapWorker. Its process is started again when it has ended or hangs: the
    store has all that was on its map.
    """

    def __init__(
        self,
        nursery: Nursery,
        settings: MapSettings,
        held: Callable[[], Sequence[SweepReadings]],
        show: Callable[[MapState], None],
        set_aside: Callable[[SweepReadings, MapProcessError], None],
        troubles: Troubles,
    ) -> None:
        """``held`` gives what a further process begins with, and holds all changes that were taken before it is called.

        ``show`` is called with each new state, ``set_aside`` with each sweep that broke the map, on one thread. Where
        ``show`` raises StoreError, the fit counts as failed.
        """
        self._nursery, self._settings = nursery, settings
        self._held, self._show, self._set_aside, self._troubles = held, show, set_aside, troubles
        self._changed = threading.Condition()
        self._waiting = Waiting()
        self._connection: Connection | None = None
        self._sending = threading.Lock()
        self._closing = threading.Event()
        self._pid: int | None = None
        self._heard_s = 0.0
        self._showing_since_s: float | None = None
        self._makes_progress = True  # as its process says
        self._figures = dict[str, int]()
        self._counts = Counter(contours=0, contour_failures=0, map_restarts=0)  # of all processes
        self._thread = threading.Thread(target=self._run, name="map-process", daemon=True)

    def start(self, held: Sequence[SweepReadings]) -> None:
        """Begin with what is ``held`` now, so that no poorer contour is seen."""
        self.take((), held)
        self._thread.start()

    def take(self, left: Sequence[Identity], entered: Sequence[SweepReadings]) -> None:
        """Have sweeps taken off the map and put on it. Never waits."""
        with self._changed:
            self._waiting.add(left, entered, monotonic())
            self._changed.notify_all()

    def watch(self) -> None:
        """Kill a process that hangs; called each second."""
        pid, silent_s = self._pid, monotonic() - self._heard_s
        if pid is None or self._showing_since_s is not None:
            return
        if silent_s >= _SILENT_AFTER_S or not self._makes_progress:
            self._pid = None
            _log.error("the map's process hangs: it is killed")
            os.kill(pid, signal.SIGKILL)

    @property
    def makes_progress(self) -> bool:
        """No state has been on its way to those who see it for ten minutes."""
        since_s = self._showing_since_s
        return since_s is None or monotonic() - since_s < _STUCK_AFTER_S

    def counters(self) -> dict[str, int]:
        """As a MapWorker's, the memory of the process, and how often it was started again."""
        figures = dict.fromkeys(_FIGURES, 0) | self._figures
        figures["sweeps_waiting"] += len(self._waiting)
        return figures | self._counts

    def close(self) -> None:
        """End the process, whatever it is at: it holds nothing that is not in the store."""
        self._closing.set()
        self._nursery.close()
        if self._thread.is_alive():
            self._thread.join(_CLOSE_WITHIN_S)

    def _run(self) -> None:
        rest = Rest()
        while not self._closing.is_set():
            began_s = monotonic()
            try:
                code = self._live(again=self._counts["map_restarts"] > 0)
            except (RuntimeError, OSError):
                if self._closing.is_set():
                    return
                raise
            if self._closing.is_set():
                return
            rest_s = rest.after(monotonic() - began_s)
            self._counts["map_restarts"] += 1
            self._figures = {}
            self._troubles.begin(
                _ENDED,
                f"the map's process ended with {code}: it starts again in {rest_s:g} s, the last contour stands, and "
                "sweeps are stored",
            )
            self._closing.wait(rest_s)

    def _live(self, again: bool) -> int:
        """One process, from its beginning to its end: its exit code. The first one gets what waits, each one that is
        begun ``again`` what is held.
        """
        connection, pid = self._nursery.begin()
        self._heard_s, self._makes_progress = monotonic(), True
        with self._changed:
            self._connection = connection
            if again:
                self._waiting = Waiting()
        if again:
            self.take((), self._held())
        sender = threading.Thread(target=self._send_changes, args=(connection,), name="map-changes", daemon=True)
        sender.start()
        self._pid = pid
        while (message := _next(connection)) is not None:
            self._hear(connection, message)
            self._heard_s = monotonic()
        self._pid = None
        with self._changed:
            self._connection = None
            self._changed.notify_all()
        sender.join()
        connection.close()
        return self._nursery.ended()

    def _send_changes(self, connection: Connection) -> None:
        self._send(connection, self._settings)
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting.since_s is not None or self._connection is not connection)
                if self._connection is not connection:
                    return
                waiting, self._waiting = self._waiting, Waiting()
            self._send(connection, Changed(waiting.left, list(waiting.entered.values())))

    def _send(self, connection: Connection, message: object) -> None:
        with suppress(OSError), self._sending:  # a process that has ended is seen where it is read
            connection.send(message)

    def _hear(self, connection: Connection, message: object) -> None:
        match message:
            case Beat(figures, makes_progress):
                self._figures, self._makes_progress = figures, makes_progress
                if figures.get("sweeps_waiting") == 0:  # all that is held is on its map
                    self._troubles.end(_ENDED, "the map is there again, in a new process")
            case PackedState():
                self._send(connection, self._shown(message.unpacked()))
            case Broke(readings, error):
                self._set_aside(readings, error)
            case Trouble(kind, text, over=True):
                self._troubles.end(kind, text)
            case Trouble(kind, text, error=error):
                self._counts["contour_failures"] += 1
                self._troubles.begin(kind, text, error)

    def _shown(self, state: MapState) -> Shown:
        self._showing_since_s = monotonic()
        try:
            self._show(state)
        except StoreError as error:
            return Shown(error)
        else:
            self._counts["contours"] += 1
        finally:
            self._showing_since_s = None
        return Shown()


def _next(connection: Connection) -> object | None:
    """The next message; None at the process's end."""
    try:
        return connection.recv()
    except (EOFError, OSError):
        return None
