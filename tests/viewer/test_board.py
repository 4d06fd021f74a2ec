"""What the board says of a site: alarms in words, a row for each unit, and a picture that stands still."""

from typing import Any

import pytest
from viewer.test_unit_pictures import components

from noctule import faults, rerun_paths
from noctule.ages import age
from noctule.messages_pb2 import (
    FAULT_KIND_TURNED,
    POSE_STATE_WRONG,
    Contour,
    Point,
    Pose,
    ServiceStatus,
    Sweep,
    Touch,
    UnitFault,
    UnitPose,
    UnitStatus,
    Wall,
)
from noctule_viewer.board import documents, drawing, map_box
from noctule_viewer.board.layout import Layout, blueprint_of, tabs_of_each
from noctule_viewer.board.layout_budget import LayoutBudget
from noctule_viewer.board.map_box import MapBox
from noctule_viewer.board.site_board import SiteBoard
from noctule_viewer.board.site_plan import SitePlan
from noctule_viewer.board.site_state import SiteState
from noctule_viewer.board.unit_health import LONGEST_SWEEP_S, Health, UnitHealth, UnitsHealth

BEGAN_S = 1_800_000_000.0


class Site:
    """A site as the viewer hears it, at a time that a test sets."""

    def __init__(self) -> None:
        self.passed_s = 0.0
        self.state = SiteState(lambda: 50.0 + self.passed_s, lambda: BEGAN_S + self.passed_s)
        self.state.note_own_trouble("")
        self._health = UnitsHealth()

    def mapper(self, detail: str = "") -> None:
        self.state.note_service(ServiceStatus(name="mapper", role="mapper", detail=detail))

    def unit(
        self, unit: str, state: "UnitStatus.State" = UnitStatus.STATE_SWEEPING, detail: str = "", log_head: int = 0
    ) -> None:
        self.state.note_alive(unit, True)
        status = UnitStatus(unit=unit, gateway="g1", state=state, detail=detail, log_head=log_head)
        status.since.FromNanoseconds(round((BEGAN_S - 3_600) * 1e9))
        self.state.note_unit(status)

    def units(self) -> list[UnitHealth]:
        return self._health.of(self.state.heard())

    def alarms(self) -> str:
        return documents.alarms("attic", self.units(), self.state.heard())


@pytest.fixture
def site() -> Site:
    return Site()


def test_a_site_without_trouble_is_well(site: Site) -> None:
    site.mapper()
    for number in range(1, 4):
        site.unit(f"u{number}")
    assert site.alarms().startswith("### attic — all is well — ")
    assert "3 units" in site.alarms()


def test_what_a_map_of_walls_could_have_more_stands_beside_it_and_is_no_alarm(site: Site) -> None:
    site.mapper()
    site.unit("u1")
    note = "echoes from 2 places; a cylinder needs 3; 2 may do, best on opposite sides of it"
    site.state.note_contour(Contour(walls=[Wall()], note=note))
    heading, *_, last = site.alarms().splitlines()
    assert heading.startswith("### attic — all is well — ")
    assert last.startswith("1 wall, ") and last.endswith(f"; 1 unit; {note}")


def test_units_that_need_attention_are_counted_and_named_on_top(site: Site) -> None:
    site.mapper()
    for number in range(1, 21):
        site.unit(f"u{number}")
    site.unit("u7", UnitStatus.STATE_FAULT, "the stepper is stuck")
    site.unit("u12", UnitStatus.STATE_DISCONNECTED, "the line is silent")
    heading = site.alarms().splitlines()[0]
    assert heading.startswith("### \u26a0 attic — 2 of 20 units need attention: u7: fault / u12: away — ")
    site.unit("u12")
    heading = site.alarms().splitlines()[0]
    assert "1 of 20 units needs attention: u7: fault: the stepper is stuck" in heading


def test_the_table_names_a_units_trouble_without_what_it_does_meanwhile(site: Site) -> None:
    site.unit("u3", UnitStatus.STATE_SWEEPING, "silent: no echo at 61 bearings")
    told = "- **u3 — NEEDS ATTENTION**: silent: no echo at 61 bearings"
    assert documents.table(site.units(), BEGAN_S) == told


def test_units_of_which_the_same_is_to_be_said_are_named_together(site: Site) -> None:
    site.mapper()
    for number in range(1, 21):
        site.unit(f"u{number}", UnitStatus.STATE_DISCONNECTED, "the line is silent")
    site.unit("u2", UnitStatus.STATE_FAULT, "the stepper is stuck")
    heading = site.alarms().splitlines()[0]
    assert "20 of 20 units need attention: u1, u3, u4, u5, u6 and 14 more: away / u2: fault — " in heading


def test_where_many_things_are_wrong_the_units_that_are_not_named_are_counted(site: Site) -> None:
    site.mapper()
    for number in range(1, 10):
        site.unit(f"u{number}", UnitStatus.STATE_SWEEPING, f"trouble {min(number, 8)}: and more of it")
    heading = site.alarms().splitlines()[0]
    told = " / ".join(f"u{number}: trouble {number}" for number in range(1, 6))
    assert f"9 of 9 units need attention: {told} / 4 more units" in heading


def test_a_mapper_that_falls_silent_is_told_however_lively_the_units_are(site: Site) -> None:
    site.mapper()
    site.passed_s = 125.0
    site.unit("u1")
    assert "no mapper is heard (mapper silent for 2 min): the map is old" in site.alarms().splitlines()[0]


def test_a_site_that_no_mapper_maps_is_told(site: Site) -> None:
    site.unit("u1")
    assert "no mapper maps this site" in site.alarms().splitlines()[0]


def test_trouble_at_another_site_is_told_on_every_tab(site: Site) -> None:
    site.unit("u1")
    worst = documents.worst("attic", site.units(), site.state.heard())
    assert worst == "attic — no mapper maps this site"
    cellar = Site()
    cellar.mapper()
    assert documents.worst("cellar", cellar.units(), cellar.state.heard()) == ""
    told = documents.alarms("cellar", cellar.units(), cellar.state.heard(), [worst]).splitlines()
    assert told[0].startswith("### cellar — all is well — ")
    assert told[2] == "**\u26a0 Other sites: attic — no mapper maps this site**"


def test_another_mapper_that_took_the_site_over_ends_the_alarm(site: Site) -> None:
    site.mapper()
    site.passed_s = 60.0
    site.state.note_service(ServiceStatus(name="second", role="mapper"))
    site.unit("u1")
    assert "all is well" in site.alarms().splitlines()[0]


def test_the_viewers_own_line_to_the_bus_is_told_first(site: Site) -> None:
    site.state.note_own_trouble("no router answers")
    assert site.alarms().startswith("### \u26a0 attic — no router answers — ")


def test_a_unit_whose_gateway_was_killed_is_away_though_its_last_status_was_good(site: Site) -> None:
    site.unit("u1")
    assert [unit.health for unit in site.units()] == [Health.WELL]
    site.passed_s = 40.0
    (unit,) = site.units()
    assert (unit.health, unit.words) == (Health.AWAY, "its gateway g1 has been silent for 40 s")
    site.state.note_alive("u1", False)
    assert site.units()[0].words == "no gateway serves it"


def test_a_unit_that_is_served_stays_so_however_many_others_are() -> None:
    state = SiteState()
    for number in range(1_100):
        state.note_alive(f"u{number}", True)
    state.note_alive("u7", True)  # as after an outage
    assert "u7" in state.heard().alive
    assert len(state.heard().alive) == 1_000


def test_a_gateway_that_no_longer_serves_a_unit_does_not_make_it_ill(site: Site) -> None:
    site.state.note_unit(UnitStatus(unit="u1", gateway="old", state=UnitStatus.STATE_FAULT, detail="stuck"))
    site.passed_s = 60.0
    site.unit("u1")
    assert [(unit.unit, unit.health) for unit in site.units()] == [("u1", Health.WELL)]


def test_health_says_since_when_it_is_as_it_is(site: Site) -> None:
    site.unit("u1")
    assert site.units()[0].since_s == BEGAN_S - 3_600  # as its gateway says: since it has answered
    site.passed_s = 10.0
    site.unit("u1", UnitStatus.STATE_FAULT, "stuck")
    assert site.units()[0].since_s == BEGAN_S + 10
    assert documents.table(site.units(), BEGAN_S) == "- **u1 — NEEDS ATTENTION**, since 08:00:10: fault: stuck"
    site.passed_s = 15.0
    site.unit("u1", UnitStatus.STATE_FAULT, "stuck")
    assert site.units()[0].since_s == BEGAN_S + 10
    site.unit("u1")
    assert site.units()[0].since_s == BEGAN_S + 15


def test_a_unit_whose_sweeps_show_a_fault_needs_attention_since_the_first_of_them(site: Site) -> None:
    fault = UnitFault(kind=FAULT_KIND_TURNED, words="it was turned by 5 degrees", advice="turn it back", confidence=0.9)
    fault.since.FromNanoseconds(round((BEGAN_S - 60) * 1e9))
    site.state.note_alive("u1", True)
    detail = faults.sentence(fault)
    site.state.note_unit(
        UnitStatus(unit="u1", gateway="g1", state=UnitStatus.STATE_SWEEPING, detail=detail, faults=[fault])
    )
    (unit,) = site.units()
    assert (unit.health, unit.since_s) == (Health.ATTENTION, BEGAN_S - 60)
    assert unit.words.startswith("sweeping: turned: it was turned by 5 degrees (since 2027-01-15 07:59 UTC, 90% sure)")
    assert "\n\nsweeping: turned: it was turned by 5 degrees" in documents.sheet(unit, BEGAN_S)


def test_a_fault_from_before_the_clock_was_set_has_no_time(site: Site) -> None:
    fault = UnitFault(kind=FAULT_KIND_TURNED, words="it was turned", advice="turn it back", confidence=0.9)
    site.state.note_alive("u1", True)
    site.state.note_unit(UnitStatus(unit="u1", gateway="g1", detail=faults.sentence(fault), faults=[fault]))
    (unit,) = site.units()
    assert (unit.health, unit.since_s) == (Health.ATTENTION, None)
    assert "(since before the clock was set, 90% sure)" in unit.words


def test_the_table_has_units_that_are_not_well_first_then_u2_before_u10(site: Site) -> None:
    for unit in ("u10", "u2", "u3"):
        site.unit(unit)
    site.unit("u3", UnitStatus.STATE_FAULT, "a | b\nc")
    sweep = Sweep(unit="u2")
    sweep.start.FromNanoseconds(round((BEGAN_S - 130) * 1e9))
    site.state.note_sweep(sweep)
    unwell, table = documents.table(site.units(), BEGAN_S).split("\n\n")
    assert unwell == "- **u3 — NEEDS ATTENTION**: fault: a | b c"
    rows = table.splitlines()[2:]
    assert [row.split("|")[1].strip() for row in rows] == ["u2", "u10"]
    assert [row.split("|")[-2].strip() for row in rows] == ["2 min ago", "none heard"]


def test_a_units_sheet_has_its_counters_clock_error_and_temperature(site: Site) -> None:
    site.state.note_alive("u1", True)
    status = UnitStatus(unit="u1", gateway="g1", state=UnitStatus.STATE_IDLE, clock_error_s=0.00123, clock_drift=42e-6)
    status.counters.update({"frames_bad": 3, "late_ms": 17})
    site.state.note_unit(status)
    sheet = documents.sheet(site.units()[0], BEGAN_S)
    assert sheet.startswith("### u1 — well: idle\n\n| since | ")
    for row in ("clock error | 1.23 ms", "clock drift | 42 ppm", "chip | not known", "frames bad | 3", "late ms | 17"):
        assert f"| {row} |" in sheet
    status.chip_temperature_c = 31.26
    assert "| chip | 31.3 °C |" in documents.sheet(site.units()[0], BEGAN_S)


def test_a_sweep_that_is_dated_in_the_future_is_the_last_one_only_until_the_next(site: Site) -> None:
    for made_s in (BEGAN_S - 5.0, BEGAN_S + 9_000.0, BEGAN_S - 1.0):
        sweep = Sweep(unit="u1")
        sweep.start.FromNanoseconds(round(made_s * 1e9))
        site.state.note_sweep(sweep)
    assert site.state.heard().swept_s == {"u1": BEGAN_S - 1.0}


def test_a_unit_at_a_wrong_place_needs_attention(site: Site) -> None:
    site.unit("u1")
    site.state.note_contour(Contour(poses=[UnitPose(unit="u1", stated=Pose(x_m=1.0), state=POSE_STATE_WRONG)]))
    (unit,) = site.units()
    assert (unit.health, unit.words) == (Health.ATTENTION, "sweeping: its stated pose is wrong")


def test_a_unit_that_says_it_sweeps_and_makes_no_sweep_needs_attention_until_the_next_one(site: Site) -> None:
    # firmware/README.md, CONFIGURE: 64 readings of 5 pings a second apart, with ramps and rests of a second; and twice
    # 296 degrees of 4400 half steps a turn, at 50 half steps/s.
    longest_s = 64 * (5 + 1 + 1) + 2 * (4400 * 296 / 360) / 50
    assert pytest.approx(longest_s) == LONGEST_SWEEP_S

    def after(passed_s: float, *of_status: Any) -> tuple[Health, str]:
        site.passed_s += passed_s
        site.unit("u1", *of_status)
        (unit,) = site.units()
        return unit.health, unit.words

    sweeping, paused = UnitStatus.STATE_SWEEPING, UnitStatus.STATE_PAUSED
    assert after(0.0, sweeping, "", 7)[0] is Health.WELL  # whatever it did before anybody looked
    assert after(longest_s - 1.0, sweeping, "", 7)[0] is Health.WELL
    assert after(61.0, sweeping, "", 7) == (Health.ATTENTION, "sweeping: no sweep has come for 10 min")
    assert documents.table(site.units(), BEGAN_S).endswith("10 min") and "no sweep has come" in site.alarms()
    assert after(1.0, sweeping, "", 8)[0] is Health.WELL
    assert after(longest_s - 1.0, paused, "", 8)[0] is Health.WELL
    assert after(longest_s + 1.0, sweeping, "", 8)[0] is Health.WELL  # it has just begun
    assert after(longest_s + 1.0, sweeping, "the line is bad", 8)[1] == "sweeping: the line is bad"


def test_a_unit_stands_where_the_contour_has_it_or_where_its_sweep_says(site: Site) -> None:
    site.state.note_sweep(Sweep(unit="u1", pose=Pose(x_m=1.0, y_m=2.0)))
    site.state.note_sweep(Sweep(unit="u2", pose=Pose(x_m=5.0, y_m=5.0)))
    site.state.note_sweep(Sweep(unit="u3", pose=Pose(sigma_position_m=100.0)))
    site.state.note_contour(Contour(poses=[UnitPose(unit="u2", x_m=3.0, y_m=4.0)]))
    assert site.state.heard().stands_m == {"u1": (1.0, 2.0), "u2": (3.0, 4.0)}


def test_the_map_has_an_orange_spot_under_a_unit_that_needs_attention_and_a_red_one_where_one_is_away(
    site: Site,
) -> None:
    for number, state in enumerate((UnitStatus.STATE_IDLE, UnitStatus.STATE_FAULT, UnitStatus.STATE_DISCONNECTED)):
        site.unit(f"u{number}", state)
        site.state.note_sweep(Sweep(unit=f"u{number}", pose=Pose(x_m=float(number), y_m=5.0)))
    site.unit("u3", UnitStatus.STATE_FAULT)  # nobody knows where it stands

    def spots() -> dict[tuple[float, ...], tuple[int, ...]]:
        drawn = components(drawing.draw_units(site.units(), site.state.heard()), rerun_paths.HEALTH)
        colours = [tuple(colour.to_bytes(4, "big")[:3]) for colour in drawn["Points2D:colors"]]
        return dict(zip(map(tuple, drawn["Points2D:positions"]), colours, strict=True))

    orange, red = (255, 176, 32), (235, 64, 64)  # as viewer/README.md names them
    assert spots() == {(1.0, 5.0): orange, (2.0, 5.0): red}
    for number in (1, 2):
        site.unit(f"u{number}")
    assert spots() == {}, "they are well again"


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


def test_a_service_that_names_thousands_of_units_neither_fills_the_table_nor_hides_a_unit_that_is_served(
    site: Site,
) -> None:
    site.unit("z1")
    service = ServiceStatus(name="archive")
    for number in range(4_000):
        service.cursors.add(unit=f"a{number}")
    site.state.note_service(service)
    assert len(site.units()) == 300
    assert site.units()[-1].unit == "z1"
    table = documents.table(site.units(), BEGAN_S)
    assert table.count("**a") == 299 and table.count("| z1 |") == 1
    assert table.endswith("\n\nNo more than 300 units are shown.")


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


def views(container: Any) -> list[Any]:
    return list(container.contents)


def contour(width_m: float) -> Contour:
    return Contour(walls=[Wall(start=Point(), end=Point(x_m=width_m, y_m=0.0))])


def test_the_picture_stands_still_while_the_map_fits_and_grows_with_it() -> None:
    alone = map_box.shown(None, [(1.0, 2.0), (3.0, 2.0)], None)
    assert map_box.shown(None, [(1.0, 2.0), (2.0, 2.5)], alone) is alone  # each new box is a new layout
    assert alone == MapBox(-1.0, 0.0, 5.0, 4.0)  # two metres around units, before there is a map
    assert map_box.shown(contour(4.0), [(2.0, 3.0)], alone) == MapBox(-0.48, -0.48, 4.48, 3.48)
    first = map_box.shown(contour(4.0), [(2.0, 3.0)], None)
    assert first == MapBox(-0.48, -0.48, 4.48, 3.48)  # 12 % of four metres around
    assert map_box.shown(contour(4.3), [(2.0, 3.0)], first) == first
    assert map_box.shown(contour(2.5), [], first) == first
    assert map_box.shown(None, [], first) == first
    touch = Contour(touches=[Touch(x_m=2.6)])
    assert map_box.shown(touch, [(0.0, 0.0)], None) == MapBox(-2.0, -2.0, 4.6, 2.0)  # two metres around what is heard
    wider = map_box.shown(contour(8.0), [], first)
    assert wider is not None
    assert wider == MapBox(-0.48, -0.48, 12.0, 3.48)  # half of eight metres beyond, where it has grown


def test_a_survey_that_grows_step_by_step_stays_in_the_picture_with_few_layouts() -> None:
    now_s = [0.0]
    budget = LayoutBudget(lambda: now_s[0])
    laid_out: MapBox | None = None
    for decimetres in range(40, 1_000):  # from a room to a hall of 100 m, in less than three hours
        now_s[0] += 10.0
        wanted = map_box.shown(contour(decimetres / 10), [(2.0, 3.0)], laid_out)
        if wanted != laid_out and budget.take(for_units=laid_out is None):
            laid_out = wanted
        assert laid_out is not None
        assert laid_out.right_m >= decimetres / 10


def test_neither_a_map_that_grows_nor_units_that_come_use_up_all_layouts() -> None:
    for for_units in (False, True):
        now_s = [0.0]
        budget = LayoutBudget(lambda now_s=now_s: now_s[0])
        taken = 0
        for _ in range(100):
            now_s[0] += 10.0
            taken += budget.take(for_units)
        assert taken == 9
        assert budget.take(not for_units) is True
        now_s[0] += 9.0
        assert budget.take(not for_units) is False, "two layouts within ten seconds"
        now_s[0] += 1.0
        assert budget.take(not for_units) is True
        now_s[0] += 6 * 3_600
        assert budget.take(for_units) is True


@pytest.mark.parametrize(
    ("side_m", "spacing_m"), [(0.9, 0.1), (4.0, 0.5), (11.0, 1.0), (30.0, 5.0), (200.0, 20.0), (12.0, 1.0)]
)
def test_the_scale_has_at_most_a_dozen_lines_of_a_round_distance(side_m: float, spacing_m: float) -> None:
    assert map_box.line_spacing_m(MapBox(0.0, 0.0, side_m, 1.0)) == pytest.approx(spacing_m)


def test_the_scales_labels_keep_clear_of_the_edges_that_would_cut_them_off() -> None:
    box = MapBox(-1.0, -1.0, 3.0, 2.0)
    drawn, between = (
        components(drawing.draw_scale(box), path) for path in (rerun_paths.SCALE, rerun_paths.SCALE_BETWEEN)
    )
    assert drawn["Points2D:labels"] == ["0 m", "1 m", "2 m", "0 m", "1 m"]
    beside_them = ["-0.5 m", "0.5 m", "1.5 m", "2.5 m", "-0.5 m", "0.5 m", "1.5 m"]
    assert between["Points2D:labels"] == beside_them


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (-3, "just now"),
        (4, "just now"),
        (40, "40 s ago"),
        (750, "12 min ago"),
        (3 * 3600, "3 h ago"),
        (5 * 86400, "5 days ago"),
    ],
)
def test_ages_are_words(seconds: float, words: str) -> None:
    assert age(seconds) == words
