"""The line to the Rerun relay: a queue that never makes its caller wait, and a worker that draws and reconnects."""

import logging
import socket
import threading
from collections import deque
from collections.abc import Callable
from time import monotonic

import rerun as rr

from noctule import rerun_paths
from noctule_mapper.rerun_view.address import host_and_port
from noctule_mapper.rerun_view.drawing import Drawing, Entries
from noctule_mapper.rerun_view.standing import Standing

_log = logging.getLogger(__name__)

_CHECK_INTERVAL_S = 1.0
_LONGEST_PAUSE_S = 30.0
_PROBE_TIMEOUT_S = 1.0
_FLUSH_TIMEOUT_S = 5.0
_CLOSE_TIMEOUT_S = 2.0
# The SDK holds hundreds of megabytes before it lets log() wait, so the link limits what it gives between two flushes.
_MOST_UNFLUSHED_BYTES = 4_000_000
_ENTRY_OVERHEAD_BYTES = 2_000  # what the SDK adds to each entry, roughly


class RerunLink:
    """Draws on a relay that may be absent, slow, killed or started again; put() returns at once whatever it is."""

    def __init__(self, url: str, site: str, statics: Callable[[], Entries], capacity: int = 256) -> None:
        """``url`` as in ``rerun+http://127.0.0.1:9876/proxy``, with ``#sites`` behind it where the relay shows several
        sites; raises RelayAddressError if it is not like that.
        """
        self._host, self._port = host_and_port(url)
        self._url = url.removesuffix(rerun_paths.SEVERAL_SITES)
        self._recording_id = rerun_paths.recording(url, site)
        self._under = "" if self._url == url else rerun_paths.under(site)
        self._statics = statics
        self._queue: deque[Drawing] = deque()
        self._capacity = capacity
        self._standing = Standing()
        self._changed = threading.Condition()
        self._closing = threading.Event()
        self._unflushed_bytes = 0
        self._reported = ""
        self._failing: set[Callable[..., Entries]] = set()
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
                self._counters["rerun_dropped"] += 1
                self._standing.drop(self._queue.popleft())
            self._queue.append(drawing)
            self._standing.put(drawing)
            self._changed.notify()

    def counters(self) -> dict[str, int]:
        """Drawings drawn and dropped; connections to the relay; stalls, where it took nothing for 5 s; failures, of
        drawings or of the link itself.
        """
        with self._changed:
            return dict(self._counters)

    def close(self) -> None:
        """Let go of the relay. A worker that the relay holds up is left behind, after 2 s."""
        self._closing.set()
        with self._changed:
            self._changed.notify()
        self._worker.join(_CLOSE_TIMEOUT_S)

    def _work(self) -> None:
        """Connect and draw until the link is closed. An error never ends the worker, it only lengthens the pause."""
        pause_s = _CHECK_INTERVAL_S
        while not self._closing.is_set():
            try:
                succeeded = self._visit()
            except Exception as error:
                succeeded = False
                self._count("rerun_failures")
                self._report(logging.ERROR, f"drawing was interrupted by {error!r}: trying again", with_traceback=True)
            pause_s = _CHECK_INTERVAL_S if succeeded else min(2.0 * pause_s, _LONGEST_PAUSE_S)
            self._closing.wait(pause_s)

    def _visit(self) -> bool:
        """Draw on the relay if it is there. False if it accepts connections but takes nothing."""
        if not self._relay_listens():
            self._report(
                logging.WARNING,
                f"no Rerun relay at {self._url}: mapping goes on, viewers will see it once the relay is up",
            )
            return True
        recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=self._recording_id)
        try:
            self._connect(recording)
            return self._serve(recording)
        finally:
            recording.disconnect()

    def _relay_listens(self) -> bool:
        """A look at the port first, because connecting to a relay that is not there takes 5 s."""
        try:
            socket.create_connection((self._host, self._port), _PROBE_TIMEOUT_S).close()
        except OSError:
            return False
        return True

    def _connect(self, recording: rr.RecordingStream) -> None:
        recording.connect_grpc(self._url)
        self._unflushed_bytes = 0
        self._log_entries(recording, self._statics(), static=True)
        with self._changed:
            self._counters["rerun_connections"] += 1
            self._standing.begin(self._queue)

    def _serve(self, recording: rr.RecordingStream) -> bool:
        """Draw until the relay goes away or the link is closed; only a flush reveals that the relay is gone.

        While flushes time out the SDK gets nothing more, and the queue drops its oldest. Returns whether any succeeded.
        """
        succeeded = stalled = False
        flushed_s = monotonic()
        while not self._closing.is_set():
            if stalled:
                self._closing.wait(_CHECK_INTERVAL_S)
            else:
                for drawing in filter(None, (self._next(), self._due())):
                    self._draw(recording, drawing)
            full = self._unflushed_bytes >= _MOST_UNFLUSHED_BYTES
            if not stalled and not full and monotonic() - flushed_s < _CHECK_INTERVAL_S:
                continue
            try:
                stalled = not self._flush(recording)
            except RuntimeError:
                self._report(logging.WARNING, f"the Rerun relay at {self._url} went away: waiting for it")
                break
            succeeded = succeeded or not stalled
            flushed_s = monotonic()
        return succeeded

    def _flush(self, recording: rr.RecordingStream) -> bool:
        """False if the relay does not take what it was given; raises RuntimeError if the relay is gone."""
        try:
            recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        except RuntimeError as error:
            if "timed out" not in str(error):
                raise
            self._count("rerun_stalls")
            self._report(
                logging.WARNING,
                f"the Rerun relay at {self._url} does not respond: viewers see an old map until it does",
            )
            return False
        self._unflushed_bytes = 0
        self._report(logging.INFO, f"drawing on the Rerun relay at {self._url}")
        return True

    def _next(self) -> Drawing | None:
        """The oldest drawing of the queue or, once it is empty, one that was missed; None if a while brings neither."""
        with self._changed:
            if not self._queue and not self._standing.missed() and not self._standing.due():
                self._changed.wait(_CHECK_INTERVAL_S)
            return self._queue.popleft() if self._queue else self._standing.missed()

    def _due(self) -> Drawing | None:
        """One that the relay may forget soon. It does not wait until the queue is empty, which may never be."""
        with self._changed:
            return self._standing.due()

    def _draw(self, recording: rr.RecordingStream, drawing: Drawing) -> None:
        recording.set_time(rerun_paths.TIME, timestamp=drawing.time_s)
        recording.set_time(rerun_paths.SWEEP, sequence=drawing.sweep)
        unflushed_bytes = self._unflushed_bytes
        try:
            self._log_entries(recording, drawing.draw(*drawing.arguments))
        except Exception:
            self._count("rerun_failures")
            if drawing.draw not in self._failing:
                self._failing.add(drawing.draw)
                _log.exception("can't draw %s: viewers miss it, mapping goes on", drawing.subject or "an event")
        else:
            self._failing.discard(drawing.draw)
            self._count("rerun_drawn")
        with self._changed:
            self._standing.drawn(drawing, self._unflushed_bytes - unflushed_bytes)

    def _log_entries(self, recording: rr.RecordingStream, entries: Entries, static: bool = False) -> None:
        for path, archetype in entries:
            batches = archetype.as_component_batches()
            content_bytes = sum(batch.as_arrow_array().nbytes for batch in batches)
            self._unflushed_bytes += content_bytes + _ENTRY_OVERHEAD_BYTES
            recording.log(f"{self._under}{path}", batches, static=static)

    def _report(self, level: int, message: str, with_traceback: bool = False) -> None:
        """Log how drawing fares, when that has changed."""
        if message != self._reported:
            self._reported = message
            _log.log(level, "%s", message, exc_info=with_traceback)

    def _count(self, counter: str) -> None:
        with self._changed:
            self._counters[counter] += 1
