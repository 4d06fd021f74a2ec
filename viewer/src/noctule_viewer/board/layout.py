"""The layout for a site that is watched: alarms above all, the map beside the table of units, a tab for each unit."""

from collections.abc import Sequence
from dataclasses import dataclass

import rerun.blueprint as rrb

from noctule import rerun_paths
from noctule_viewer import blueprint
from noctule_viewer.board import echo_history, polar
from noctule_viewer.board.map_box import MapBox

MOST_TABS = 30  # of all sites: a layout takes about 125 kB of the relay's memory for each
_SHOW_RAYS_OF = 4  # units; the rays of more hide the map, and each unit's own tab shows them
_MOST_LINES_NAMED = 6  # in a plot: the names of more hide the lines


@dataclass(frozen=True)
class Layout:
    """What the layout of a site depends on: tabs are a fixed list, and so are the bounds of the map. ``under`` is what
    its entities are under, as rerun_paths.under() has it, empty where the relay shows one site only. No more than the
    first ``most_tabs`` units have tabs.
    """

    units: tuple[str, ...]
    box: MapBox | None
    site: str = ""
    under: str = ""
    most_tabs: int = MOST_TABS

    def views(self) -> rrb.Vertical:
        """Alarms, and under them the tabs."""
        alarms = rrb.TextDocumentView(origin=self._at(rerun_paths.ALARMS), name="Alarms", titlebar=False)
        of_units = map(self._unit, self.units[: self.most_tabs])
        states = blueprint.states_view(self.under)  # forty pixels a unit: beside figures there is room for three
        tabs = rrb.Tabs(self._site(), *of_units, self._figures(), states, active_tab=0)
        return rrb.Vertical(alarms, tabs, row_shares=[3, 14], name=self.site)

    def _at(self, path: str) -> str:
        return f"/{self.under}{path}"

    def _site(self) -> rrb.Horizontal:
        table = rrb.TextDocumentView(origin=self._at(rerun_paths.UNITS_TABLE), name="Units")
        events = blueprint.events_view(self._at(rerun_paths.LOG))
        beside = rrb.Tabs(table, events, active_tab=0)  # the table of twenty units needs all of the height
        many = len(self.units) > _SHOW_RAYS_OF
        rays = [f"- {self._at(rerun_paths.unit_rays(unit))}" for unit in self.units] if many else []
        world = self._map([f"{self._at(rerun_paths.WORLD)}/**", *rays], "Map", self._bounds())
        return rrb.Horizontal(world, beside, column_shares=[5, 4], name="Site")

    def _unit(self, unit: str) -> rrb.Horizontal:
        around = [rerun_paths.WALLS, rerun_paths.CYLINDERS, rerun_paths.CORNERS, rerun_paths.SCALE]
        sheet = rrb.TextDocumentView(origin=self._at(rerun_paths.unit_sheet(unit)), name="State")
        figures = rrb.Horizontal(
            blueprint.figures_view(self._at(rerun_paths.unit_clock_error(unit)), "Clock error, ms", named=False),
            blueprint.figures_view(self._at(rerun_paths.unit_temperature(unit)), "Chip, °C", named=False),
        )
        events = blueprint.events_view(self._at(rerun_paths.unit_log(unit)), "Events of the unit")
        in_room = [f"{self._at(rerun_paths.unit_pose(unit))}/**", *map(self._at, around)]
        room = self._map(in_room, "Last sweep in the room", self._bounds())
        sweeps = rrb.Vertical(rrb.Horizontal(self._polar(unit), room), self._history(unit), row_shares=[4, 3])
        beside = rrb.Vertical(sheet, figures, events, row_shares=[4, 2, 2])
        return rrb.Horizontal(sweeps, beside, column_shares=[3, 2], name=unit)

    def _figures(self) -> rrb.Vertical:
        clocks, contour = blueprint.figure_views(self.under, named=len(self.units) <= _MOST_LINES_NAMED)
        errors = blueprint.figures_view(f"{self._at(rerun_paths.MAP_ERRORS)}/**", "Errors that the map states, mm")
        explained = blueprint.figures_view(
            self._at(rerun_paths.map_fit("explained")), "Echoes that the map explains, %", named=False
        )
        distance = blueprint.figures_view(
            self._at(rerun_paths.map_fit("distance")), "Their distance from the map, mm", named=False
        )
        of_map = rrb.Horizontal(errors, explained, distance)
        return rrb.Vertical(of_map, rrb.Horizontal(clocks, contour), name="Figures")

    def _polar(self, unit: str) -> rrb.Spatial2DView:
        bounds = rrb.VisualBounds2D(x_range=[-polar.EDGE, polar.EDGE], y_range=[-polar.EDGE, polar.LOWER_EDGE])
        return self._map([f"{self._at(rerun_paths.unit_polar(unit))}/**"], "Last sweep from the unit", bounds)

    def _history(self, unit: str) -> rrb.Spatial2DView:
        bounds = rrb.VisualBounds2D(
            x_range=[-echo_history.LEFT, echo_history.COLUMNS + echo_history.RIGHT],
            y_range=[-echo_history.ABOVE, echo_history.ROWS + echo_history.BELOW],
        )
        return self._map([f"{self._at(rerun_paths.unit_echo_history(unit))}/**"], "Echoes by bearing and time", bounds)

    def _map(self, contents: list[str], name: str, bounds: rrb.VisualBounds2D | None) -> rrb.Spatial2DView:
        return blueprint.map_view(contents, name, bounds, f"/{self.under.rstrip('/')}")

    def _bounds(self) -> rrb.VisualBounds2D | None:
        if self.box is None:
            return None
        # Rerun's own y points down.
        return rrb.VisualBounds2D(
            x_range=[self.box.left_m, self.box.right_m], y_range=[-self.box.top_m, -self.box.bottom_m]
        )


def tabs_of_each(sites: int) -> int:
    """How many units of each of so many ``sites`` have tabs."""
    return max(1, MOST_TABS // sites)


def blueprint_of(sites: Sequence[Layout]) -> rrb.Blueprint:
    """The layout for Rerun: a tab for each site, if there are several."""
    if len(sites) == 1:
        return blueprint.arranged(sites[0].views())
    return blueprint.arranged(rrb.Tabs(*(site.views() for site in sites), active_tab=0))
