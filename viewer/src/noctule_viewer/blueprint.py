"""The layout of the viewer: a large map, and beside it what units and mapper are doing, whatever units there are.

    python -m noctule_viewer.blueprint URL

sends it to a relay. What the layout of a watched site (board/layout.py) has in common with it stands here too.
"""

import sys
from collections.abc import Sequence

import rerun.blueprint as rrb
from rerun.encodings import TimeRange

from noctule import rerun_paths
from noctule.ending import end_with

# Rerun's own time of logging: in it a site, a simulated one that runs faster and a replayed survey are all live.
_WATCHED = "log_time"
CALM = [17, 21, 28]
_MAP_SHARE, _SIDE_SHARE = 5, 2
_RECENT = TimeRange(
    start=rrb.TimeRangeBoundary.cursor_relative(seconds=-600.0), end=rrb.TimeRangeBoundary.cursor_relative()
)


def blueprint() -> rrb.Blueprint:
    """Views select entities by wildcard, so a unit that comes later needs no new layout."""
    heading = rrb.TextDocumentView(origin=f"/{rerun_paths.HEARTBEAT}", name="Noctule", titlebar=False)
    world = map_view([f"/{rerun_paths.WORLD}/**"], "Map", None)
    beside = rrb.Vertical(states_view(), *figure_views(), events_view(), row_shares=[2, 2, 2, 4])
    return arranged(
        rrb.Horizontal(
            rrb.Vertical(heading, world, row_shares=[1, 12]), beside, column_shares=[_MAP_SHARE, _SIDE_SHARE]
        )
    )


def arranged(views: rrb.Container) -> rrb.Blueprint:
    """``views`` and no panels of Rerun's own around them; the page follows what is logged."""
    return rrb.Blueprint(
        views,
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=_WATCHED, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def map_view(
    contents: Sequence[str], name: str, bounds: rrb.VisualBounds2D | None, origin: str = "/"
) -> rrb.Spatial2DView:
    """Without ``bounds`` the view shows all there is at the time. ``origin`` is where all entities of the site are."""
    # The origin is the parent of the entity that turns y upwards: a view does not apply its own origin's transform.
    return rrb.Spatial2DView(origin=origin, contents=list(contents), name=name, background=CALM, visual_bounds=bounds)


def figure_views(under: str = "", named: bool = True) -> list[rrb.View]:
    """All units' clocks and the mapper's pace, over the last minutes; ``under`` as in Layout. The clocks' lines are
    ``named`` if that leaves room for them.
    """
    units = f"/{under}units/**"
    pace = [f"/{under}{rerun_paths.mapper_counter(name)}" for name in ("contour_fit_ms", "contour_delay_ms")]
    clocks = figures_view(units, "Clock error, ms", named=named)
    return [clocks, figures_view(pace, "Contour, ms")]


def states_view(under: str = "") -> rrb.StateTimelineView:
    """What each unit has done over the last minutes; ``under`` as in Layout."""
    origin = f"/{under.rstrip('/')}"
    return rrb.StateTimelineView(
        origin=origin,
        contents=[f"/{under}states/**"],
        name="States of the units",
        time_ranges=_recent(),
        time_view=_recent_axis(),
    )


def figures_view(contents: str | Sequence[str], name: str, named: bool = True) -> rrb.TimeSeriesView:
    """Figures over the last minutes, their lines ``named`` if the names leave room for them."""
    paths = [contents] if isinstance(contents, str) else list(contents)
    legend = rrb.PlotLegend(visible=named)
    return rrb.TimeSeriesView(
        origin="/", contents=paths, name=name, time_ranges=_recent(), axis_x=_recent_axis(), plot_legend=legend
    )


def events_view(origin: str = f"/{rerun_paths.LOG}", name: str = "Events") -> rrb.TextLogView:
    """What has happened, in words."""
    columns = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin=origin, name=name, columns=columns)


def _recent() -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(_WATCHED, start=_RECENT.start, end=_RECENT.end)


def _recent_axis() -> rrb.archetypes.TimeAxis:
    """All of the last minutes: by itself a plot of few points shows only the half minute around the present."""
    return rrb.archetypes.TimeAxis(view_range=_RECENT)


def _send(url: str) -> None:
    blueprint().connect_grpc(rerun_paths.APPLICATION_ID, url=url, make_active=True, make_default=True)


if __name__ == "__main__":
    end_with(lambda: _send(sys.argv[1]))
