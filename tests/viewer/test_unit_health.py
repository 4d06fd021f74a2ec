"""Which unit is well, in words, and since when."""

from typing import Any

import pytest
from viewer.heard_site import BEGAN_S, Site

from noctule import faults
from noctule.messages_pb2 import (
    FAULT_KIND_TURNED,
    POSE_STATE_WRONG,
    Contour,
    Pose,
    ServiceStatus,
    Sweep,
    UnitFault,
    UnitPose,
    UnitStatus,
)
from noctule_viewer.board import documents
from noctule_viewer.board.site_state import SiteState
from noctule_viewer.board.unit_health import LONGEST_SWEEP_S, Health


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
