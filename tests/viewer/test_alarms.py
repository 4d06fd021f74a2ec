"""What the board says of a site: alarms in words, a row for each unit, and a spot on the map."""

import pytest
from viewer.heard_site import BEGAN_S, Site
from viewer.test_unit_pictures import components

from noctule import rerun_paths
from noctule.ages import age
from noctule.messages_pb2 import (
    Contour,
    Pose,
    ServiceStatus,
    Sweep,
    UnitStatus,
    Wall,
)
from noctule_viewer.board import documents, drawing


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
