"""Draws the boards of sites on the relay, on a thread of its own: a relay that is frozen holds up nothing else."""

import logging
import threading
from collections.abc import Sequence
from time import time
from typing import Self

import rerun as rr

from noctule import rerun_paths
from noctule_viewer.board import drawing, layout
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.layout import Layout
from noctule_viewer.board.layout_budget import LayoutBudget
from noctule_viewer.board.site_board import SiteBoard
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import SiteState

_ALARMS_EVERY_S = 1.0
_FLUSH_TIMEOUT_S = 5.0
_END_WITHIN_S = 0.5

_log = logging.getLogger(__name__)


class Board:
    """Shows sites on the relay at ``url``, each a tab if there are several, from its making until close()."""

    def __init__(self, url: str, sites: Sequence[tuple[SitePlan, SiteState]], recording_id: str) -> None:
        self._url = url
        one = len(sites) == 1
        most_tabs = layout.tabs_of_each(len(sites))
        self._sites = [
            SiteBoard(plan, state, "" if one else rerun_paths.under(plan.site), most_tabs) for plan, state in sites
        ]
        self._recording_id = recording_id
        self._layouts: tuple[Layout, ...] = ()
        self._budget = LayoutBudget()
        self._told = ""
        self.drawn_s: float | None = None  # UTC: when the relay has last taken all of it
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def troubles(self) -> list[str]:
        """The worst of each site where not all is well. From any thread."""
        return [site.worst for site in self._sites if site.worst]

    def close(self) -> None:
        """Draw no more. A thread that the relay holds up is left behind, after half a second."""
        self._closed.set()
        self._thread.join(_END_WITHIN_S)

    def _run(self) -> None:
        recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=self._recording_id)
        recording.connect_grpc(self._url)
        for site in self._sites:
            _log_entries(recording, site.under, site.statics(), static=True)
        while not self._closed.is_set():
            try:
                self._draw(recording)
                recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
                self.drawn_s = time()
            except Exception as error:  # the relay is frozen, or ends and this process with it
                self._tell(str(error))
                self._wait_for(recording)
            self._closed.wait(_ALARMS_EVERY_S)
        recording.disconnect()

    def _tell(self, error: str) -> None:
        if error != self._told and not self._closed.is_set():
            self._told = error
            _log.warning("the board of %s was not drawn: %s; it is tried again", self._recording_id, error)

    def _wait_for(self, recording: rr.RecordingStream) -> None:
        """Until the relay has taken what it was given: more would pile up in this process."""
        while not self._closed.wait(_ALARMS_EVERY_S):
            for site in self._sites:
                site.judge(site.heard())
            try:
                recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
                return
            except Exception:
                continue

    def _draw(self, recording: rr.RecordingStream) -> None:
        for site in self._sites:
            heard = site.heard()
            recording.set_time(rerun_paths.TIME, timestamp=heard.now_s)
            elsewhere = [other.worst for other in self._sites if other is not site and other.worst]
            _log_entries(recording, site.under, site.entries(heard, elsewhere))
        self._lay_out(recording, tuple(site.layout() for site in self._sites))

    def _lay_out(self, recording: rr.RecordingStream, wanted: tuple[Layout, ...]) -> None:
        if wanted == self._layouts:
            return
        if self._budget.take(for_units=[each.units for each in wanted] != [each.units for each in self._layouts]):
            before, self._layouts = self._layouts, wanted
            recording.send_blueprint(layout.blueprint_of(wanted), make_active=True, make_default=True)
            for each in wanted:
                if each.box is not None and each not in before:
                    _log_entries(recording, each.under, drawing.draw_scale(each.box), static=True)


def _log_entries(recording: rr.RecordingStream, under: str, entries: Entries, static: bool = False) -> None:
    for path, archetype in entries:
        recording.log(f"{under}{path}", archetype, static=static)
