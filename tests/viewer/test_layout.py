"""The layout of a watched site: its tabs, what each shows, and how far back."""

from typing import Any

from noctule import rerun_paths
from noctule_viewer.board.layout import Layout, blueprint_of, tabs_of_each
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.board.site_board import SiteBoard
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import SiteState


def views(container: Any) -> list[Any]:
    return list(container.contents)


def test_each_unit_has_a_tab_and_all_maps_show_the_same_part_of_the_site() -> None:
    layout = blueprint_of([Layout(("u1", "u2"), MapBox(-1.0, -2.0, 3.0, 4.0))])
    _, tabs = views(layout.root_container)
    assert [tab.name for tab in views(tabs)] == ["Site", "u1", "u2", "Figures", "States of the units"]
    site, *units, _, _ = views(tabs)
    pictures = [views(views(unit)[0]) for unit in units]  # of sweeps, beside what is said in words
    assert [[view.name for view in views(row)] for row, _ in pictures] == 2 * [
        ["Last sweep from the unit", "Last sweep in the room"]
    ]
    assert [history.name for _, history in pictures] == 2 * ["Echoes by bearing and time"]
    maps = [views(site)[0], *(views(row)[1] for row, _ in pictures)]
    for map_view in maps:  # Rerun's y points down
        (bounds,) = map_view.properties["VisualBounds2D"].range.as_arrow_array().to_pylist()
        assert (bounds["x_range"], bounds["y_range"]) == ([-1.0, 3.0], [-4.0, 2.0])


def test_plots_and_states_show_all_of_the_last_ten_minutes() -> None:
    _, tabs = views(blueprint_of([Layout(("u1",), None)]).root_container)
    *_, figures, states = views(tabs)
    of_time = [view for row in views(figures) for view in views(row)] + [states]
    assert len(of_time) == 6
    for view in of_time:
        (span,) = view.properties["TimeAxis"].view_range.as_arrow_array().to_pylist()
        assert (span["start"], span["end"]) == (-600_000_000_000, 0)


def test_no_more_than_thirty_units_get_tabs_and_the_rays_of_all_are_left_out() -> None:
    layout = blueprint_of([Layout(tuple(f"u{number}" for number in range(1, 41)), None)])
    _, tabs = views(layout.root_container)
    names = [tab.name for tab in views(tabs)]
    assert names == ["Site", *(f"u{number}" for number in range(1, 31)), "Figures", "States of the units"]
    contents = views(views(tabs)[0])[0].contents
    assert [f"- /{rerun_paths.unit_rays(unit)}" in contents for unit in ("u1", "u40")] == [True, True]


def test_the_tabs_are_shared_among_the_sites_of_a_relay() -> None:
    states = [(SitePlan(name), SiteState()) for name in ("attic", "cellar", "shed")]
    for _, state in states:
        for number in range(1, 41):
            state.note_alive(f"u{number}", True)
    boards = [SiteBoard(plan, state, rerun_paths.under(plan.site), tabs_of_each(len(states))) for plan, state in states]
    for board in boards:
        list(board.entries(board.heard()))
    tabs = [[tab.name for tab in views(views(board.layout().views())[1])] for board in boards]
    assert tabs == 3 * [["Site", *(f"u{number}" for number in range(1, 11)), "Figures", "States of the units"]]
    assert (tabs_of_each(1), tabs_of_each(100)) == (30, 1)


def test_several_sites_have_a_tab_each_with_their_own_alarms_units_and_map() -> None:
    attic = Layout(("u1",), MapBox(-1.0, -2.0, 3.0, 4.0), "attic", rerun_paths.under("attic"))
    cellar = Layout(("u1", "u2"), None, "cellar", rerun_paths.under("cellar"))
    sites = views(blueprint_of([attic, cellar]).root_container)
    assert [site.name for site in sites] == ["attic", "cellar"]
    for site, of_site in zip(sites, ("attic", "cellar"), strict=True):
        alarms, tabs = views(site)
        assert alarms.origin == f"/{of_site}/board/alarms"
        world = views(views(tabs)[0])[0]
        assert (world.origin, world.contents) == (f"/{of_site}", [f"/{of_site}/world/**"])
    assert [tab.name for tab in views(views(sites[1])[1])] == ["Site", "u1", "u2", "Figures", "States of the units"]
