"""Turns to speak: who could hear whom, the timetable, and a unit kept at its turns. No line, no clock."""

from dataclasses import replace
from itertools import combinations
from math import pi, radians
from pathlib import Path
from random import Random

import pytest
from gateway.link_rig import AT_REST, SWEEPING, Rig
from gateway.model_unit import ModelUnit
from gateway.oscillator import Oscillator, exchanges
from gateway.test_unit_status import HELLO, STATUS

from noctule.site import load
from noctule_gateway.clock.boot_clocks import BootClocks, TickLine
from noctule_gateway.clock.regression import GOOD_DRIFT_ERROR, Exchange
from noctule_gateway.turns.hearing import HEARD_AFTER_M, Place, could_hear
from noctule_gateway.turns.keeper import RENEWED_AFTER_S, TurnKeeper, drifted_s, in_ticks
from noctule_gateway.turns.site_turns import not_reckoned_with, pace_of, site_turns
from noctule_gateway.turns.timetable import (
    DRIFTS_S,
    MOST_SLOTS,
    SHORTEST_SLOT_S,
    Crowd,
    Pace,
    Turn,
    period,
    timetable,
)
from noctule_gateway.unit.plans import FIXED_PLAN, OWN_PLAN, expected_plan
from noctule_gateway.wire import frames

AHEAD = (radians(-30), radians(60))  # an arc of 60 degrees along x
BACK = (radians(150), radians(60))
ALL_ROUND = (0.0, 2 * pi)


# ---- Who could hear whom ----


@pytest.mark.parametrize(
    ("apart_m", "one", "other", "heard"),
    [
        (3.0, AHEAD, BACK, True),  # face to face
        (3.0, AHEAD, AHEAD, True),  # one looks at the other's back, and a wall beyond the other sends it back
        (3.0, BACK, AHEAD, False),  # back to back: no wall is before both
        (3.0, BACK, ALL_ROUND, True),
        (7.9, AHEAD, BACK, True),
        (8.1, AHEAD, BACK, False),
        (8.1, ALL_ROUND, ALL_ROUND, False),
        (7.9, AHEAD, AHEAD, True),  # a wall 5 cm behind the other
    ],
)
def test_units_hear_each_other_straight_or_off_a_wall_that_both_look_at(apart_m, one, other, heard):
    places = [Place(0.0, 0.0, *one), Place(apart_m, 0.0, *other)]
    assert could_hear(*places) == could_hear(*reversed(places)) == heard


def test_what_may_stand_nearer_than_it_was_measured_may_be_heard():
    places = [Place(x_m, 0.0, *ALL_ROUND, sigma_m=0.05) for x_m in (0.0, HEARD_AFTER_M + 0.2)]
    assert could_hear(*places)
    assert not could_hear(*(replace(place, sigma_m=0.0) for place in places))


# ---- The timetable ----

READING = Pace(turn_s=0.2)


def all_heard(names: list[str]) -> dict[str, list[str]]:
    return {name: [other for other in names if other != name] for name in names}


def test_of_any_two_that_could_hear_each_other_one_is_silent_while_the_other_listens():
    random = Random(4)
    for _ in range(200):
        names = [f"u{number}" for number in range(12)]
        pairs = [pair for pair in combinations(names, 2) if random.random() < 0.25]
        heard = {name: [other for pair in pairs if name in pair for other in pair if other != name] for name in names}
        turns = timetable({name: Pace(random.uniform(0.1, 0.6)) for name in names}, heard)
        assert set(turns) == {name for pair in pairs for name in pair}
        for one, other in pairs:
            first, second = turns[one], turns[other]
            assert isinstance(first, Turn) and isinstance(second, Turn)
            assert first.period_s == second.period_s
            apart_s = abs(first.offset_s - second.offset_s)
            assert min(apart_s, first.period_s - apart_s) >= first.slot_s - 1e-9 >= SHORTEST_SLOT_S - 2e-9


def test_units_that_nobody_hears_need_no_turns_and_rooms_apart_have_periods_of_their_own():
    heard = {"a": ["b"], "b": ["a"], "c": [], **all_heard(["d", "e", "f", "g", "h"])}
    turns = timetable({name: READING for name in heard}, heard)
    assert set(turns) == set("abdefgh")
    periods_s = {name: turn.period_s for name, turn in turns.items() if isinstance(turn, Turn)}
    assert periods_s["a"] == periods_s["b"] < periods_s["d"]


def test_more_units_than_there_are_slots_have_no_turns_and_know_how_many_they_are():
    names = [f"u{number}" for number in range(MOST_SLOTS + 1)]
    assert set(timetable({name: READING for name in names}, all_heard(names)).values()) == {Crowd(MOST_SLOTS + 1)}
    assert all(
        isinstance(turn, Turn) for turn in timetable(dict.fromkeys(names[1:], READING), all_heard(names[1:])).values()
    )


# No sweep is to be more than 1.3 times longer than alone for two units, 2 for four. Five pings a reading, 60 ms apart
# where two slots take 92 and four 184, can't keep to that.
@pytest.mark.parametrize(
    ("slots", "pings", "most"), [(2, 1, 1.3), (2, 3, 1.3), (2, 5, 1.5), (4, 1, 2.0), (4, 3, 2.0), (4, 5, 2.3)]
)
@pytest.mark.parametrize("plan", [FIXED_PLAN, OWN_PLAN], ids=["fine", "coarse"])
def test_no_reading_takes_much_longer_by_turns_than_alone(slots, pings, most, plan):
    reading = pace_of(replace(plan, pings=pings))
    period_s = period([reading], slots)
    assert period_s >= slots * SHORTEST_SLOT_S
    assert reading.by_turns_s(period_s) <= most * reading.alone_s


# ---- The site file ----

UNIT = """[[unit]]
name = "u{number}"
serial = {number}
address = "/dev/ttyUSB{number}"
"""


def turns_of(folder: Path, *units: str, head: str = ""):
    path = folder / "site.toml"
    path.write_text(
        f'site = "s"\n{head}\n' + "".join(UNIT.format(number=n) + text + "\n" for n, text in enumerate(units, 1))
    )
    site = load(path)
    return site_turns(site, {unit.name: expected_plan(unit) for unit in site.units})


def at(x_m: float, room: str = "") -> str:
    return f"pose = {{ x_m = {x_m}, y_m = 0.0, heading_deg = 90 }}" + (f'\nroom = "{room}"' if room else "")


def test_units_of_one_room_have_turns_and_those_of_another_named_room_do_not_count(tmp_path):
    assert set(turns_of(tmp_path, at(0.0), at(3.0), at(30.0))) == {"u1", "u2"}
    assert turns_of(tmp_path, at(0.0, "kitchen"), at(3.0, "hall")) == {}
    assert set(turns_of(tmp_path, at(0.0, "kitchen"), at(3.0))) == {"u1", "u2"}  # it may stand in the kitchen


def test_a_unit_whose_place_is_to_be_found_could_hear_all_and_one_that_is_carried_has_no_turns(tmp_path):
    assert set(turns_of(tmp_path, at(0.0), 'pose = "unknown"')) == {"u1", "u2"}
    assert turns_of(tmp_path, at(0.0), 'pose = "key"') == {}


def test_a_site_whose_units_have_times_of_their_own_has_no_common_grid(tmp_path):
    assert turns_of(tmp_path, at(0.0), at(3.0), head='clock = "unit"') == {}


def test_a_plan_that_looks_further_than_the_site_files_names_who_could_hear_it_out_of_turn(tmp_path):
    looks = "sweep = {{ first_bearing_deg = {first_deg}, bearing_step_deg = 10, count = 2 }}"
    narrow = f"{at(0.0)}\n{looks.format(first_deg=-90)}"  # along x
    back = f"{at(-3.0)}\n{looks.format(first_deg=90)}"
    (tmp_path / "site.toml").write_text(
        'site = "s"\n' + "".join(UNIT.format(number=n) + text + "\n" for n, text in enumerate((narrow, back), 1))
    )
    site = load(tmp_path / "site.toml")
    plans = {unit.name: expected_plan(unit) for unit in site.units}
    turns = site_turns(site, plans)
    assert turns == {}  # back to back
    assert not_reckoned_with(site, plans, turns, "u1", plans["u1"]) == []
    assert not_reckoned_with(site, plans, turns, "u1", FIXED_PLAN) == ["u2"]
    both = site_turns(site, {**plans, "u1": FIXED_PLAN})
    assert not_reckoned_with(site, plans, both, "u1", FIXED_PLAN) == []  # they have turns all the same


# ---- A unit kept at its turns ----

TURN = Turn(offset_s=0.05, period_s=0.2, slot_s=0.05)
STARTED, IN_TURN = 0x02, 0x08
OLD, NEW = (replace(HELLO, version_minor=minor) for minor in (4, 5))
UTC_S = 1.8e9
START = frames.Start(0, 500)


def line(fast: float = 0.01, tick: int = 2**33, utc_s: float = UTC_S, error_s: float = 0.0005) -> TickLine:
    return TickLine(tick, utc_s, 0.25e-6 / (1 + fast), error_s)


def keeper(hello: frames.Hello = NEW, turn: Turn | Crowd | None = TURN) -> TurnKeeper:
    kept = TurnKeeper(turn)
    kept.met(hello, 100.0)
    kept.said(replace(STATUS, flags=STARTED))
    return kept


@pytest.mark.parametrize("fast", [-0.015, 0.0, 0.015])
def test_turns_are_told_in_the_units_own_ticks(fast):
    given = in_ticks(TURN, line(fast))
    turn_utc_s = UTC_S + (given.tick - 2**33) * 0.25e-6 / (1 + fast)
    assert UTC_S <= turn_utc_s <= UTC_S + TURN.period_s
    off_s = (turn_utc_s - TURN.offset_s + TURN.period_s / 2) % TURN.period_s - TURN.period_s / 2
    assert off_s == pytest.approx(0.0, abs=1e-6)
    assert given.period == round(0.2 * 4e6 * (1 + fast))
    assert drifted_s(given, TURN, line(fast)) == pytest.approx(0.0, abs=1e-6)


def test_a_unit_that_was_taken_for_too_slow_pings_ever_sooner_than_its_turns():
    given = in_ticks(TURN, line(fast=0.010))
    later = line(fast=0.0101, tick=2**33 + round(4e6 * 1.0101 * 10), utc_s=UTC_S + 10)
    # 1e-4 of 10 s: it counts on with a period that is too short by so much.
    assert drifted_s(given, TURN, later) == pytest.approx(-1e-3, abs=5e-6)


def test_it_is_told_again_when_it_has_drifted_and_not_before():
    kept = keeper()
    first = kept.start(START, line(), 100.0)
    assert first.period and first.pause_ms == 500
    kept.said(replace(STATUS, flags=STARTED | IN_TURN))
    now_s, tick = 110.0, 2**33 + round(4e6 * 1.01 * 10)
    true = line(tick=tick, utc_s=UTC_S + 10)
    assert not kept.look(true, now_s)
    assert not kept.look(replace(true, utc_s=true.utc_s + 0.9 * DRIFTS_S), now_s)
    assert kept.look(replace(true, utc_s=true.utc_s + 1.1 * DRIFTS_S), now_s)
    assert kept.look(replace(true, utc_s=true.utc_s - 1.1 * DRIFTS_S), now_s)
    assert not kept.look(replace(true, utc_s=true.utc_s + 0.05), 100.0 + RENEWED_AFTER_S - 0.1)


def test_a_clock_that_is_not_good_costs_the_turns_and_is_named_after_a_while():
    kept = keeper()
    bad = line(error_s=1.01 * TURN.clock_error_s)
    assert kept.start(START, bad, 100.0) == START
    assert kept.trouble(101.0) == ""
    assert "its clock" in kept.trouble(131.0)
    assert not kept.look(bad, 131.0)
    assert kept.look(line(), 131.0)
    assert kept.start(START, line(), 131.0).period
    assert kept.trouble(132.0) == ""
    kept.said(replace(STATUS, flags=STARTED | IN_TURN))
    assert not kept.look(replace(bad, error_s=1.4 * TURN.clock_error_s), 140.0)  # so it does not come and go
    assert kept.look(replace(bad, error_s=1.6 * TURN.clock_error_s), 140.0)
    assert kept.start(START, replace(bad, error_s=1.6 * TURN.clock_error_s), 140.0) == START


def test_older_firmware_is_started_as_it_knows_it_and_named():
    kept = keeper(OLD)
    assert kept.start(START, line(), 100.0) == START
    assert not kept.look(line(), 200.0)
    assert "its firmware knows no turns" in kept.trouble(100.0)


def test_a_unit_that_does_not_sweep_has_nothing_to_say():
    for hello, turn in ((OLD, TURN), (NEW, TURN), (NEW, Crowd(9))):
        kept = keeper(hello, turn)
        kept.said(replace(STATUS, flags=0))
        assert not kept.look(line(), 200.0) and kept.trouble(200.0) == ""


def test_a_crowd_is_named_and_a_unit_alone_has_nothing_to_say():
    crowd = keeper(turn=Crowd(9))
    assert crowd.start(START, line(), 100.0) == START and not crowd.look(line(), 200.0)
    assert crowd.trouble(100.0).startswith("9 units could hear each other")
    alone = keeper(turn=None)
    assert alone.start(START, line(), 100.0) == START and alone.trouble(200.0) == ""


def test_a_plan_that_the_turns_do_not_reckon_with_is_named_also_where_the_unit_had_none():
    for turn in (TURN, None):
        kept = keeper(turn=turn)
        kept.start(START, line(), 100.0)
        kept.goes_by(["u2", "u3"])
        assert "so u2, u3 may hear its pings" in kept.trouble(100.0)
        kept.goes_by([])
        assert kept.trouble(100.0) == ""


def test_a_unit_that_has_lost_its_turns_gets_them_again_and_one_that_is_stopped_does_not():
    kept = keeper()
    kept.start(START, line(), 100.0)
    kept.said(replace(STATUS, flags=STARTED))  # a START that has not arrived
    assert kept.look(line(), 103.0)
    kept.said(replace(STATUS, flags=0))
    assert not kept.look(line(), 103.0)


def test_a_boots_ticks_are_told_as_utc_with_the_error_of_the_next_seconds():
    clocks = BootClocks(nominal=False, anchor=lambda _: None)
    assert clocks.line(UTC_S) is None
    clocks.begin(5, 1000.0, UTC_S)
    unit = Oscillator(0.01)
    for exchange in exchanges(unit, 60, seed=6):
        clocks.add(exchange)
    told = clocks.line(UTC_S)
    assert told is not None
    assert 0.25e-6 / told.tick_s == pytest.approx(1.01, abs=2e-4)
    for ahead_s in (0.0, 3.0):
        host_s = told.utc_s - UTC_S + ahead_s
        assert (unit.tick(host_s) - told.tick) * told.tick_s == pytest.approx(ahead_s, abs=3 * told.error_s)
    assert clocks.error_s < told.error_s < 0.003


def test_a_clock_whose_best_exchange_was_long_ago_is_bounded_by_the_latest_one():
    clocks = BootClocks(nominal=False, anchor=lambda _: None)
    clocks.begin(5, 1000.0, UTC_S)
    unit = Oscillator(0.01)
    for second in range(90):
        half_trip_s = 20e-6 if second == 9 else 0.8e-3
        tick = unit.tick(1000.0 + second)
        clocks.add(Exchange(1000.0 + second - half_trip_s, tick, tick, 1000.0 + second + half_trip_s))
    told = clocks.line(UTC_S)
    assert told is not None
    assert clocks.error_s > 2e-3
    assert told.error_s < 0.8e-3 + 3.0 * GOOD_DRIFT_ERROR + 0.1e-3
    assert not clocks.add(Exchange(1090.05, unit.tick(1090.0), unit.tick(1090.0), 1090.06))  # contradicts the line
    told = clocks.line(UTC_S)
    assert told is not None and told.error_s > 2e-3


def test_a_link_starts_a_running_unit_again_with_its_turns_and_never_one_that_was_stopped():
    rig = Rig(ModelUnit(), SWEEPING)
    rig.link.start_again()  # not served yet
    rig.run(3.0)
    begun = list(rig.unit.carried_out)
    rig.link.start_again()
    rig.run(1.0)
    assert rig.unit.carried_out == [*begun, frames.Start(0, 250)]
    rig.link.order(frames.Stop(0))
    rig.link.start_again()
    rig.run(2.0)
    assert rig.unit.carried_out[-1] == frames.Stop(0)
    rig.link.start_again()
    rig.run(2.0)
    assert rig.unit.carried_out[-1] == frames.Stop(0)


def test_what_goes_out_as_start_is_what_has_the_turns():
    rig = Rig(ModelUnit(), AT_REST)
    rig.link = type(rig.link)(7, AT_REST, 40, lambda start, now_s: replace(start, turn=round(now_s), period=800_000))
    rig.link.connected(rig.now_s)
    rig.run(2.0)
    ticket = rig.link.order(START)
    rig.run(1.0)
    assert rig.settled(ticket).error is None
    assert rig.unit.carried_out[-1] == frames.Start(0, 500, 102, 800_000)  # the rig's time begins at 100 s
