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

from noctule_mapper.live.looks import STUCK_AFTER, Looks
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
_SILENT_AFTER = 30  # looks, one each second, as the beats
_CLOSE_WITHIN_S = 1.0
_FIGURES = ("contour_fit_ms", "contour_delay_ms", "sweeps_waiting", "sweeps_off_grid", "map_memory_bytes", "map_cpu_ms")

_Change = tuple[Sequence[Identity], Sequence[SweepReadings], float]


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
        Where it raises StoreError, it is called again later.

        ``show`` is called with each new state, ``set_aside`` with each sweep that broke the map, on one thread. Where
        ``show`` raises StoreError, the fit counts as failed.
        """
        self._nursery, self._settings = nursery, settings
        self._held, self._show, self._set_aside, self._troubles = held, show, set_aside, troubles
        self._changed = threading.Condition()
        self._waiting = Waiting()
        self._meanwhile: list[_Change] | None = None  # what is taken while it is read what is held
        self._connection: Connection | None = None
        self._sending = threading.Lock()
        self._closing = threading.Event()
        self._pid: int | None = None
        self._received, self._shows = 0, False  # messages so far; whether a state is being shown
        self._looks = Looks()
        self._process_makes_progress = True  # as it says
        self.makes_progress = True
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
            if self._meanwhile is None:
                self._waiting.add(left, entered, monotonic())
                self._changed.notify_all()
            else:
                self._meanwhile.append((left, entered, monotonic()))

    def watch(self) -> None:
        """Kill a process that hangs; called each second. ``makes_progress`` is False from when a state has been on its
        way to those who see it for ten minutes.
        """
        pid, shows = self._pid, self._shows
        unchanged = self._looks.unchanged((pid, shows, self._received))
        self.makes_progress = not shows or unchanged < STUCK_AFTER
        if shows or pid is None:
            return
        if unchanged >= _SILENT_AFTER or not self._process_makes_progress:
            self._pid = None
            _log.error("the map's process hangs: it is killed")
            with suppress(ProcessLookupError):  # it has just ended
                os.kill(pid, signal.SIGKILL)

    def counters(self) -> dict[str, int]:
        """As a MapWorker's, memory and CPU of the process, and how often it was started again."""
        figures = dict.fromkeys(_FIGURES, 0) | self._figures
        figures["sweeps_waiting"] += len(self._waiting)
        return figures | self._counts

    def close(self) -> None:
        """End the process at once: it holds nothing that is not in the store."""
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
            except StoreError as error:
                self._troubles.begin(_ENDED, f"{error}; the map's process starts again when it can be read")
                self._closing.wait(rest.after(0.0))
                continue
            except BaseException:
                if self._closing.is_set():  # what it works with is being closed
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
        if again:
            self._wait_with_all()
        connection, pid = self._nursery.begin()
        self._process_makes_progress = True
        with self._changed:
            self._connection = connection
        sender = threading.Thread(target=self._send_changes, args=(connection,), name="map-changes", daemon=True)
        sender.start()
        self._pid = pid
        while (message := _receive(connection)) is not None:
            self._received += 1
            self._react(connection, message)
        self._pid = None
        with self._changed:
            self._connection = None
            self._changed.notify_all()
        sender.join()
        connection.close()
        return self._nursery.ended()

    def _wait_with_all(self) -> None:
        """Have all that is held wait. What is taken while it is read may be in it or not: in both cases these changes
        apply to it. Raises what ``held`` raises.
        """
        waiting, meanwhile = Waiting(), list[_Change]()
        with self._changed:
            self._meanwhile = meanwhile
        try:
            waiting.add((), self._held(), monotonic())
        finally:
            with self._changed:
                for change in meanwhile:
                    waiting.add(*change)
                self._waiting, self._meanwhile = waiting, None

    def _send_changes(self, connection: Connection) -> None:
        self._send(connection, self._settings)
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting.since_s is not None or self._connection is not connection)
                if self._connection is not connection:
                    return
                waiting, self._waiting = self._waiting, Waiting()
                assert waiting.since_s is not None
            self._send(connection, Changed(waiting.left, list(waiting.entered.values()), waiting.since_s))

    def _send(self, connection: Connection, message: object) -> None:
        with suppress(OSError), self._sending:  # a process that has ended is seen where it is read
            connection.send(message)

    def _react(self, connection: Connection, message: object) -> None:
        match message:
            case Beat(figures, makes_progress):
                self._figures, self._process_makes_progress = figures, makes_progress
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
        self._shows = True
        try:
            self._show(state)
        except StoreError as error:
            return Shown(error)
        finally:
            self._received, self._shows = self._received + 1, False
        self._counts["contours"] += 1
        self._troubles.end(_ENDED, "the map is there again, in a new process")
        return Shown()


def _receive(connection: Connection) -> object | None:
    """The next message; None at the process's end."""
    try:
        return connection.recv()
    except (EOFError, OSError):
        return None
