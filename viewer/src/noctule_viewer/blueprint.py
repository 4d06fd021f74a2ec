"""The layout of the viewer: a large map, and beside it what units and mapper are doing, whatever units there are.

    python -m noctule_viewer.blueprint URL

sends it to a relay.
"""

import sys

import rerun.blueprint as rrb

from noctule import rerun_paths

# Rerun's own time of logging: in it a site, a simulated one that runs faster and a replayed survey are all live.
_WATCHED = "log_time"
_CALM = [17, 21, 28]
_MAP_SHARE, _SIDE_SHARE = 5, 2
_RECENT_S = 120.0


def blueprint() -> rrb.Blueprint:
    """Views select entities by wildcard, so a unit that comes later needs no new layout."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_heartbeat(), _map(), row_shares=[1, 12]),
            rrb.Vertical(_states(), _clocks(), _pace(), _events(), row_shares=[2, 2, 2, 4]),
            column_shares=[_MAP_SHARE, _SIDE_SHARE],
        ),
        rrb.TopPanel(state="hidden"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=_WATCHED, play_state="following"),
        auto_layout=False,
        auto_views=False,
    )


def _heartbeat() -> rrb.TextDocumentView:
    return rrb.TextDocumentView(origin=f"/{rerun_paths.HEARTBEAT}", name="Noctule", titlebar=False)


def _map() -> rrb.Spatial2DView:
    # The origin is the parent of the entity that turns y upwards: a view does not apply its own origin's transform.
    return rrb.Spatial2DView(
        origin="/", contents=[f"/{rerun_paths.WORLD}/**"], name="Map", background=_CALM, titlebar=False
    )


def _states() -> rrb.StateTimelineView:
    return rrb.StateTimelineView(origin="/", contents=["/units/**"], name="Units", time_ranges=_recent())


def _clocks() -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(origin="/", contents=["/units/**"], name="Clock error, ms", time_ranges=_recent())


def _pace() -> rrb.TimeSeriesView:
    counters = [f"/{rerun_paths.mapper_counter(name)}" for name in ("contour_fit_ms", "contour_delay_ms")]
    return rrb.TimeSeriesView(origin="/", contents=counters, name="Contour, ms", time_ranges=_recent())


def _events() -> rrb.TextLogView:
    columns = rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin=f"/{rerun_paths.LOG}", name="Events", columns=columns)


def _recent() -> rrb.VisibleTimeRange:
    return rrb.VisibleTimeRange(
        _WATCHED,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-_RECENT_S),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )


if __name__ == "__main__":
    blueprint().connect_grpc(rerun_paths.APPLICATION_ID, url=sys.argv[1], make_active=True, make_default=True)
