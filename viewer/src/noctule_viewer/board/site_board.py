"""All that is drawn of one site that is watched, each thing when it is due."""

from collections.abc import Sequence
from time import monotonic

from noctule_viewer.board import documents, drawing, echo_history, map_box, polar
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.heard_sweeps import HeardSweep
from noctule_viewer.board.layout import MOST_TABS, Layout
from noctule_viewer.board.map_board import MapBoard
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import Heard, SiteState
from noctule_viewer.board.turns import DRAWN_AGAIN_AFTER_S, Turns
from noctule_viewer.board.unit_health import Health, UnitHealth, UnitsHealth

_UNITS_EVERY_S = 3.0
_SHEETS_EVERY_S = _TEMPERATURES_EVERY_S = 30.0  # each costs the relay two kilobytes, for each unit
_POLAR_EVERY_S, _HISTORY_EVERY_S = 2.0, 8.0  # one unit after the other


class SiteBoard:
    """Draws ``state``. Where the relay shows several sites, its entities are ``under`` the site's name; ``most_tabs``
    as in Layout.
    """

    def __init__(self, plan: SitePlan, state: SiteState, under: str = "", most_tabs: int = MOST_TABS) -> None:
        self.site, self.under = plan.site, under
        self._most_tabs = most_tabs
        self.worst = ""  # trouble, by what was judged last
        self._state = state
        self._map = MapBoard(plan)
        self._health = UnitsHealth()
        self._box: MapBox | None = None
        self._units: tuple[str, ...] = ()
        self._due_s: dict[str, float] = {}
        self._sheets: dict[str, tuple[Health, float]] = {}  # by unit: the health on it, and when it is due again
        self._rings: dict[str, tuple[float, float]] = {}  # by unit: the outermost range, and when they are due again
        self._polar_turns, self._history_turns = Turns(_POLAR_EVERY_S), Turns(_HISTORY_EVERY_S)

    def statics(self) -> Entries:
        """What stands for good."""
        return self._map.statics()

    def layout(self) -> Layout:
        """What is wanted of the layout, by what was drawn last."""
        return Layout(self._units, self._box, self.site, self.under, self._most_tabs)

    def heard(self) -> Heard:
        """What the site has said until now."""
        return self._state.heard()

    def judge(self, heard: Heard) -> list[UnitHealth]:
        """How the units fare, and what is the worst."""
        units = self._health.of(heard)
        self.worst = documents.worst(self.site, units, heard)
        return units

    def entries(self, heard: Heard, elsewhere: Sequence[str] = ()) -> Entries:
        """What is due now; ``elsewhere`` are the troubles of the other sites."""
        units = self.judge(heard)
        with_tabs = units[: self._most_tabs]
        self._units = tuple(unit.unit for unit in units)
        self._box = map_box.shown(heard.contour, heard.stands_m.values(), self._box)
        yield from drawing.draw_alarms(self.site, units, heard, elsewhere)
        if self._is_due(_UNITS_EVERY_S, "units"):
            yield from drawing.draw_units(units, heard)
        if self._is_due(_TEMPERATURES_EVERY_S, "temperatures"):
            yield from drawing.draw_temperatures(with_tabs)
        for unit in self._take_due_sheets(with_tabs):
            yield from drawing.draw_sheet(unit, heard)
        yield from self._pictures(with_tabs, heard)
        yield from self._map.entries(heard)

    def _pictures(self, units: list[UnitHealth], heard: Heard) -> Entries:
        sweeps = {unit.unit: heard.sweeps[unit.unit] for unit in units if unit.unit in heard.sweeps}
        outermost_m = {unit: polar.outermost_m(of_unit) for unit, of_unit in sweeps.items()}
        newest_s = {unit: of_unit[-1].time_s for unit, of_unit in sweeps.items()}
        self._rings = {unit: last for unit, last in self._rings.items() if unit in sweeps}
        if (unit := self._polar_turns.take(newest_s)) is not None:
            yield from self._polar(unit, sweeps[unit][-1], outermost_m[unit])
        if (unit := self._history_turns.take(newest_s)) is not None:
            yield from echo_history.draw_echo_history(unit, sweeps[unit], outermost_m[unit], heard.now_s)

    def _polar(self, unit: str, sweep: HeardSweep, outermost_m: float) -> Entries:
        """The sweep, and with it the rings where their scale is another: one without the other would be misread."""
        now_s = monotonic()
        last = self._rings.get(unit)
        if last is None or last[0] != outermost_m or now_s >= last[1]:
            self._rings[unit] = outermost_m, now_s + DRAWN_AGAIN_AFTER_S
            yield from polar.draw_rings(unit, outermost_m, sweep.beam_width_rad)
        yield from polar.draw_polar(unit, sweep, outermost_m)

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

    def _is_due(self, interval_s: float, what: str) -> bool:
        now_s = monotonic()
        if now_s < self._due_s.get(what, now_s):
            return False
        self._due_s[what] = now_s + interval_s
        return True
