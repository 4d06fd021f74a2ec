"""Draws the board of a site on the relay, on a thread of its own: a relay that is frozen holds up nothing else."""

import logging
import threading
from collections.abc import Callable
from time import monotonic
from typing import Self

import rerun as rr

from noctule import rerun_paths
from noctule_viewer.board import drawing, echo_history, map_box, polar
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.layout import MOST_TABS, Layout
from noctule_viewer.board.layout_budget import LayoutBudget
from noctule_viewer.board.map_board import MapBoard
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import Heard, SiteState
from noctule_viewer.board.turns import Turns
from noctule_viewer.board.unit_health import Health, UnitHealth, UnitsHealth

_ALARMS_EVERY_S = 1.0
_UNITS_EVERY_S = 3.0
_SHEETS_EVERY_S = _TEMPERATURES_EVERY_S = 30.0  # each costs the relay two kilobytes, for each unit
_RINGS_EVERY_S, _POLAR_EVERY_S, _HISTORY_EVERY_S = 1.0, 2.0, 8.0  # one unit after the other
_FLUSH_TIMEOUT_S = 5.0
_END_WITHIN_S = 0.5

_log = logging.getLogger(__name__)


class Board:
    """Shows ``state`` on the relay at ``url`` from its making until close()."""

    def __init__(self, url: str, plan: SitePlan, state: SiteState) -> None:
        self._url, self._site, self._state = url, plan.site, state
        self._map = MapBoard(plan)
        self._health = UnitsHealth()
        self._box: MapBox | None = None
        self._layout: Layout | None = None
        self._budget = LayoutBudget()
        self._due_s: dict[str, float] = {}
        self._sheets: dict[str, tuple[Health, float]] = {}  # by unit: the health on it, and when it is due again
        self._rings_turns = Turns(_RINGS_EVERY_S)
        self._polar_turns, self._history_turns = Turns(_POLAR_EVERY_S), Turns(_HISTORY_EVERY_S)
        self._told = ""
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name="board", daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Draw no more. A thread that the relay holds up is left behind, after half a second."""
        self._closed.set()
        self._thread.join(_END_WITHIN_S)

    def _run(self) -> None:
        recording = rr.RecordingStream(rerun_paths.APPLICATION_ID, recording_id=self._site)
        recording.connect_grpc(self._url)
        _log_entries(recording, self._map.statics(), static=True)
        while not self._closed.is_set():
            try:
                self._draw(recording)
                recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
            except Exception as error:  # the relay is frozen, or ends and this process with it
                self._tell(str(error))
                self._wait_for(recording)
            self._closed.wait(_ALARMS_EVERY_S)
        recording.disconnect()

    def _tell(self, error: str) -> None:
        if error != self._told and not self._closed.is_set():
            self._told = error
            _log.warning("the board of site %s was not drawn: %s; it is tried again", self._site, error)

    def _wait_for(self, recording: rr.RecordingStream) -> None:
        """Until the relay has taken what it was given: more would pile up in this process."""
        while not self._closed.wait(_ALARMS_EVERY_S):
            try:
                recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
                return
            except Exception:
                continue

    def _draw(self, recording: rr.RecordingStream) -> None:
        heard = self._state.heard()
        units = self._health.of(heard)
        with_tabs = units[:MOST_TABS]
        recording.set_time(rerun_paths.TIME, timestamp=heard.now_s)
        _log_entries(recording, drawing.draw_alarms(self._site, units, heard))
        self._at_most_every(_UNITS_EVERY_S, "units", lambda: _log_entries(recording, drawing.draw_units(units, heard)))
        self._at_most_every(
            _TEMPERATURES_EVERY_S, "temperatures", lambda: _log_entries(recording, drawing.draw_temperatures(with_tabs))
        )
        for unit in self._take_due_sheets(with_tabs):
            _log_entries(recording, drawing.draw_sheet(unit, heard))
        self._draw_looks(recording, with_tabs, heard)
        _log_entries(recording, self._map.entries(heard))
        self._lay_out(recording, units, heard)

    def _draw_looks(self, recording: rr.RecordingStream, units: list[UnitHealth], heard: Heard) -> None:
        looks = {unit.unit: heard.looks[unit.unit] for unit in units if unit.unit in heard.looks}
        outermost_m = {unit: polar.outermost_m(of_unit) for unit, of_unit in looks.items()}
        newest_s = {unit: of_unit[-1].time_s for unit, of_unit in looks.items()}
        if (unit := self._rings_turns.take(outermost_m)) is not None:
            _log_entries(recording, polar.draw_rings(unit, outermost_m[unit], looks[unit][-1].beam_width_rad))
        if (unit := self._polar_turns.take(newest_s)) is not None:
            _log_entries(recording, polar.draw_polar(unit, looks[unit][-1], outermost_m[unit]))
        if (unit := self._history_turns.take(newest_s)) is not None:
            entries = echo_history.draw_echo_history(unit, looks[unit], outermost_m[unit], heard.now_s)
            _log_entries(recording, entries)

    def _lay_out(self, recording: rr.RecordingStream, units: list[UnitHealth], heard: Heard) -> None:
        self._box = map_box.shown(heard.contour, heard.stands_m.values(), self._box)
        wanted = Layout(tuple(unit.unit for unit in units), self._box)
        if wanted == self._layout:
            return
        if self._budget.take(for_units=self._layout is None or wanted.units != self._layout.units):
            self._layout = wanted
            recording.send_blueprint(wanted.blueprint(), make_active=True, make_default=True)
            if self._box is not None:
                _log_entries(recording, drawing.draw_scale(self._box), static=True)

    def _take_due_sheets(self, units: list[UnitHealth]) -> list[UnitHealth]:
        """Those whose sheet is due, or whose health is another. They are noted as drawn, and other units forgotten."""
        now_s = monotonic()
        known = {unit.unit: self._sheets.get(unit.unit) for unit in units}
        due = [
            unit
            for unit in units
            if (last := known[unit.unit]) is None or last[0] is not unit.health or now_s >= last[1]
        ]
        drawn = {unit.unit: (unit.health, now_s + _SHEETS_EVERY_S) for unit in due}
        self._sheets = {name: last for name, last in known.items() if last is not None} | drawn
        return due

    def _at_most_every(self, interval_s: float, what: str, draw: Callable[[], None]) -> None:
        if self._is_due(interval_s, what):
            draw()

    def _is_due(self, interval_s: float, what: str) -> bool:
        now_s = monotonic()
        if now_s < self._due_s.get(what, now_s):
            return False
        self._due_s[what] = now_s + interval_s
        return True


def _log_entries(recording: rr.RecordingStream, entries: Entries, static: bool = False) -> None:
    for path, archetype in entries:
        recording.log(path, archetype, static=static)
