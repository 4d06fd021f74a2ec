"""What the board adds to the map, and its figures: changes, planned paths, the floor plan, errors and residuals."""

from collections.abc import Callable, Iterator
from time import monotonic

import rerun as rr

from noctule import rerun_paths
from noctule.rerun_together import Together
from noctule_viewer.board import fit_figures, plan_marks
from noctule_viewer.board.changes import Changes
from noctule_viewer.board.entries import Entries
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import Heard
from noctule_viewer.board.turns import Turns

_FIGURES_EVERY_S, _CHANGES_EVERY_S, _PATHS_EVERY_S = 15.0, 15.0, 1.0
_RECENT_S = 600.0  # a unit that has not swept for longer says nothing of the map as it is
_FLOOR_PLAN = (98, 116, 146)
# As on the map; corners as the echoes that lie on them, poses as units.
_KINDS = {
    "walls": (236, 240, 245),
    "corners": (255, 214, 102),
    "cylinders": (255, 140, 66),
    "unit poses": (86, 204, 242),
}
_FLOOR_PLAN_ORDER = 2.0  # above the grid of metres, below all that was measured


class MapBoard:
    """Entries that are due, each time that it is asked; ``now`` counts seconds evenly."""

    def __init__(self, plan: SitePlan, now: Callable[[], float] = monotonic) -> None:
        self._plan, self._now = plan, now
        self._changes = Changes()
        self._figures_turns, self._changes_turns = Turns(_FIGURES_EVERY_S, now), Turns(_CHANGES_EVERY_S, now)
        self._path_turns = Turns(_PATHS_EVERY_S, now)

    def statics(self) -> Entries:
        """What stands for good: y points up, which the mapper says too, but that may come later or not at all. A floor
        plan without lines too, because a recording may give an earlier one back.
        """
        yield rerun_paths.WORLD, rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]])
        lines = rr.LineStrips2D(
            self._plan.floor_plan_m,
            colors=[_FLOOR_PLAN],
            radii=rr.Radius.ui_points(1.0),
            draw_order=_FLOOR_PLAN_ORDER,
        )
        yield rerun_paths.FLOOR_PLAN, lines

    def entries(self, heard: Heard) -> Entries:
        """What is due now."""
        yield from self._paths(heard)
        if heard.contour is None:
            return
        self._changes.note(heard.contour, heard.now_s)
        if self._figures_turns.take({"map": heard.now_s}) is not None:
            yield from _figures(heard)
        changes = self._changes.changes(heard.now_s)
        # Ages go on as long as there are changes; without any nothing has to be drawn again.
        if self._changes_turns.take({"map": heard.now_s if changes else 0.0}) is not None:
            yield from plan_marks.draw_changes(changes, heard.now_s)

    def _paths(self, heard: Heard) -> Entries:
        waypoints = {unit: _waypoint(unit, heard) for unit in self._plan.paths}
        states = {unit: -1.0 if waypoint is None else waypoint for unit, waypoint in waypoints.items()}
        if (unit := self._path_turns.take(states)) is not None:
            yield from plan_marks.draw_path(unit, self._plan.paths[unit], waypoints[unit])


def _figures(heard: Heard) -> Iterator[tuple[str, rr.AsComponents]]:
    assert heard.contour is not None
    for kind, error_mm in fit_figures.errors_mm(heard.contour).items():
        line = rr.SeriesLines(colors=[_KINDS[kind]], names=[kind])
        yield rerun_paths.map_error(kind), Together(rr.Scalars(error_mm), line)
    newest = {unit: sweeps[-1] for unit, sweeps in heard.sweeps.items() if heard.now_s - sweeps[-1].time_s < _RECENT_S}
    for figure, value in fit_figures.fit(fit_figures.residuals_m(heard.contour, newest)).items():
        yield rerun_paths.map_fit(figure), rr.Scalars(value)


def _waypoint(unit: str, heard: Heard) -> int | None:
    """The stop that ``unit`` says it is at."""
    statuses = [(heard.unit_silent_s[key], status) for key, status in heard.units.items() if key[0] == unit]
    if not statuses:
        return None
    _, status = min(statuses, key=lambda each: each[0])
    return status.waypoint if status.HasField("waypoint") else None
