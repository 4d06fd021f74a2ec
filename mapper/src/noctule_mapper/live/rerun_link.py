"""The line to the Rerun relay: a queue that never makes its caller wait, and a worker that draws and reconnects."""

import logging
import re
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from time import monotonic
from typing import Any

import rerun as rr

from noctule import scene
from noctule.errors import NoctuleError

_log = logging.getLogger(__name__)

Entries = Iterable[tuple[str, rr.AsComponents]]
"""Entity paths and what to log there."""

_CHECK_INTERVAL_S = 1.0
_PROBE_TIMEOUT_S = 1.0
_FLUSH_TIMEOUT_S = 5.0
_CLOSE_TIMEOUT_S = 3.0


class RelayAddressError(NoctuleError):
    """An address that is not one of a Rerun relay."""


@dataclass(frozen=True)
class Drawing:
    """Something to show. ``draw(*arguments)`` makes its entries, on the link's worker.

    ``subject`` names what it shows: the last drawing of each subject is drawn again when the relay may have missed it.
    An event has none.
    """

    draw: Callable[..., Entries]
    arguments: tuple[Any, ...]
    time_s: float
    sweep: int
    subject: str | None = None


class RerunLink:
    """Draws on a relay that may be absent, slow, killed or started again; put() returns at once whatever it is."""

    def __init__(self, url: str, recording_id: str, statics: Callable[[], Entries], capacity: int = 256) -> None:
        """``url`` as in ``rerun+http://127.0.0.1:9876/proxy``; raises RelayAddressError if it is not like that."""
        self._url, self._host, self._port = url, *_host_and_port(url)
        self._recording_id = recording_id
        self._statics = statics
        self._queue: deque[Drawing] = deque()
        self._capacity = capacity
        self._present: dict[str, Drawing] = {}  # the last drawing of each subject
        self._missed: dict[str, Drawing] = {}  # those of the present that were dropped or went to a relay that is gone
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._counters = {
            "rerun_drawn": 0,
            "rerun_dropped": 0,
            "rerun_connections": 0,
            "rerun_stalls": 0,
            "rerun_failures": 0,
        }
        self._worker = threading.Thread(target=self._work, name="rerun-link", daemon=True)
        self._worker.start()

    def put(self, drawing: Drawing) -> None:
        """Show ``drawing`` when its turn comes; the oldest in the queue makes way if there is no room."""
        with self._changed:
            if len(self._queue) == self._capacity:
                self._drop(self._queue.popleft())
            self._queue.append(drawing)
            if drawing.subject is not None:
                self._present[drawing.subject] = drawing
                self._missed.pop(drawing.subject, None)
            self._changed.notify()

    def counters(self) -> dict[str, int]:
        """Drawings drawn, dropped and failed; connections to the relay, and stalls where it did not keep up."""
        with self._changed:
            return dict(self._counters)

    def close(self) -> None:
        """Let go of the relay. A worker that the relay holds up is left behind, after 3 s."""
        self._closing.set()
        with self._changed:
            self._changed.notify()
        self._worker.join(_CLOSE_TIMEOUT_S)

    def _drop(self, drawing: Drawing) -> None:
        self._counters["rerun_dropped"] += 1
        if drawing.subject is not None and self._present[drawing.subject] is drawing:
            self._missed[drawing.subject] = drawing

    def _work(self) -> None:
        absent = False
        while not self._closing.is_set():
            if self._relay_listens():
                absent = False
                self._serve(self._connect())
            elif not absent:
                absent = True
                _log.warning(
                    "no Rerun relay at %s: mapping goes on, viewers will see it once the relay is up", self._url
                )
            self._closing.wait(_CHECK_INTERVAL_S)

    def _relay_listens(self) -> bool:
        """A look at the port first, because connecting to a relay that is not there takes 5 s."""
        try:
            socket.create_connection((self._host, self._port), _PROBE_TIMEOUT_S).close()
        except OSError:
            return False
        return True

    def _connect(self) -> rr.RecordingStream:
        recording = rr.RecordingStream(scene.APPLICATION_ID, recording_id=self._recording_id)
        recording.connect_grpc(self._url)
        for path, archetype in self._statics():
            recording.log(path, archetype, static=True)
        with self._changed:
            self._counters["rerun_connections"] += 1
            queued = {id(drawing) for drawing in self._queue}
            self._missed = {subject: each for subject, each in self._present.items() if id(each) not in queued}
        _log.info("drawing on the Rerun relay at %s", self._url)
        return recording

    def _serve(self, recording: rr.RecordingStream) -> None:
        """Draw until the relay goes away, which the SDK tells no one but who flushes, or the link is closed."""
        checked_s = monotonic()
        while not self._closing.is_set():
            for drawing in self._next():
                self._draw(recording, drawing)
            if monotonic() - checked_s >= _CHECK_INTERVAL_S:
                if not self._connected(recording):
                    _log.warning("the Rerun relay at %s went away: waiting for it", self._url)
                    break
                checked_s = monotonic()
        recording.disconnect()

    def _next(self) -> list[Drawing]:
        """The oldest drawing of the queue or, once it is empty, what was missed; nothing if a while brings neither."""
        with self._changed:
            if not self._queue and not self._missed:
                self._changed.wait(_CHECK_INTERVAL_S)
            if self._queue:
                return [self._queue.popleft()]
            missed, self._missed = self._missed, {}
            return list(missed.values())

    def _draw(self, recording: rr.RecordingStream, drawing: Drawing) -> None:
        recording.set_time(scene.TIME, timestamp=drawing.time_s)
        recording.set_time(scene.SWEEP, sequence=drawing.sweep)
        try:
            for path, archetype in drawing.draw(*drawing.arguments):
                recording.log(path, archetype)
        except Exception:
            _log.exception("can't draw %s: viewers miss it, mapping goes on", drawing.subject or "an event")
            self._count("rerun_failures")
        else:
            self._count("rerun_drawn")

    def _connected(self, recording: rr.RecordingStream) -> bool:
        try:
            recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            if "timed out" not in str(error):
                return False
            self._count("rerun_stalls")
        return True

    def _count(self, counter: str) -> None:
        with self._changed:
            self._counters[counter] += 1


def _host_and_port(url: str) -> tuple[str, int]:
    address = re.fullmatch(r"rerun\+http://([^/:]+):(\d{1,5})/proxy", url)
    if address is None:
        raise RelayAddressError(f"{url!r} is not a relay's address: it should read rerun+http://HOST:PORT/proxy")
    return address[1], int(address[2])
