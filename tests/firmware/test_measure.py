"""What a unit measures of itself: gear, play, a round, a ping, by the real firmware; and how it ends where it can't."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from math import degrees
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.measure import gear, play
from noctule_gateway.measure.edges import Edges
from noctule_gateway.wire.frames import (
    NEVER,
    AskMechanics,
    AskStatus,
    Calibrate,
    Configure,
    GoTo,
    Home,
    HomeKind,
    Measure,
    Measured,
    MeasureKind,
    Mechanics,
    Outcome,
    Single,
    Start,
    State,
    Status,
    Stop,
    Sweep,
)

HALF_STEPS_PER_TURN = 25792 / 405 * 64
HALF_STEP_DEG = 360 / HALF_STEPS_PER_TURN
FREE = "stop_deg = 720.0\nhome_arc_deg = 20.0\n"
TICKS_PER_MS = 4000
# firmware/README.md, MEASURE: a home at 600 half steps/s, then a turn of 4,900 at 250 both ways.
LONGEST_S = 60.0

Place = Callable[..., SteppedUnit]


@pytest.fixture
def placed(tmp_path: Path) -> Iterator[Place]:
    """A function that gives a unit with this [motor] and [sensor] before a wall, which has said hello."""
    with ExitStack() as stack:

        def place(motor: str = "", sensor: str = "", home: HomeKind = HomeKind.SWITCH, seed: int = 1) -> SteppedUnit:
            room = tmp_path / "room.toml"
            wall = "[[wall]]\nfrom_m = [1.0, -9.0]\nto_m = [1.0, 9.0]\n"
            stand = "[unit]\nposition_m = [0.0, 0.0]\n"
            room.write_text(f'name = "bench"\n[motor]\n{motor}\n[sensor]\n{sensor}\n{wall}{stand}')
            unit = stack.enter_context(stepped_unit("--room", str(room), "--seed", str(seed)))
            unit.greet()
            assert unit.command(calibration(home)) == Outcome.DONE
            return unit

        yield place


def calibration(home: HomeKind = HomeKind.SWITCH, backlash: int = 0) -> Calibrate:
    return Calibrate(0, round(HALF_STEPS_PER_TURN * 256), backlash, home, round(-150 / 360 * 65536))


def measured(unit: SteppedUnit, kind: MeasureKind) -> Mechanics:
    assert unit.command(Measure(0, kind)) == Outcome.DONE
    return ended(unit)


def ended(unit: SteppedUnit) -> Mechanics:
    """The measurement, when it is over: within its time, with the motor off."""
    began_s = unit.now_s
    while unit.receive(Status, LONGEST_S).state not in (State.IDLE, State.FAULT):
        pass
    assert unit.now_s - began_s <= LONGEST_S
    unit.run(0.1)
    assert not unit.truth["coils_on"]
    return unit.ask(AskMechanics(0), Mechanics)


@pytest.mark.parametrize(
    ("turn", "named"),
    [(HALF_STEPS_PER_TURN, "1/63.684"), (4096.0, "gear 1/64"), (64 * 16.032, "1/16.032"), (3990.0, "no gear known")],
)
@pytest.mark.parametrize("backlash", [0, 20])
def test_a_turn_is_measured_from_edge_to_edge_and_its_gear_is_named(placed, turn, named, backlash):
    unit = placed(f"{FREE}half_steps_per_turn = {turn}\nbacklash_deg = {backlash * 360 / turn}")
    found = gear.measurement([measured(unit, MeasureKind.TURN)], calibration())
    assert found.value == pytest.approx(turn, abs=1.0)  # an edge is found to a half step
    assert named in found.words
    verdicts = {HALF_STEPS_PER_TURN: found.VERDICT_GOOD}
    assert found.verdict == verdicts.get(turn, found.VERDICT_BAD)
    assert ("replace the motor" in found.words) == (turn < 3800)


def check_where_it_looks(unit: SteppedUnit) -> None:
    """The unit is homed, looks where it says, and its next check finds no slip."""
    assert unit.ask(AskStatus(0), Status).homed
    assert unit.command(GoTo(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    assert abs(degrees(unit.truth["bearing_rad"])) <= 1.0
    assert unit.command(Home(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    assert abs(unit.ask(AskMechanics(0), Mechanics).slip) <= 3 * 65536 / HALF_STEPS_PER_TURN


@pytest.mark.parametrize("motor", [FREE, "stop_deg = 165.0", "stop_deg = 165.0\nhome_arc_deg = 20.0"])
@pytest.mark.parametrize("kind", [MeasureKind.PLAY, MeasureKind.TURN, MeasureKind.ROUND])
def test_after_a_measurement_the_unit_knows_where_it_looks_though_it_met_a_stop(placed, motor, kind):
    unit = placed(motor)
    measured(unit, kind)
    check_where_it_looks(unit)


def test_a_round_ends_in_time_however_slow_the_plan_is(placed):
    unit = placed()
    assert unit.command(Configure(0, -24576, 4096, 13, 60, 50, 1000, 20, 1)) == Outcome.DONE  # 50 half steps/s
    found = Edges.of(measured(unit, MeasureKind.ROUND))
    assert found.up[0] - found.down[-1] == 1


@pytest.mark.parametrize("seed", range(1, 4))
def test_after_a_round_that_lost_steps_the_unit_knows_where_it_looks(placed, seed):
    unit = placed(seed=seed)
    assert unit.command(Measure(0, MeasureKind.ROUND)) == Outcome.DONE
    unit.wait_for_state(State.MEASURING)
    unit.inject("motor_loses_steps", probability=0.002)
    ended(unit)
    unit.inject("mended")
    check_where_it_looks(unit)


def test_a_unit_that_does_not_find_home_again_after_a_measurement_is_not_homed(placed):
    unit = placed()
    assert unit.command(Measure(0, MeasureKind.ROUND)) == Outcome.DONE
    unit.wait_for_state(State.MEASURING)
    unit.run(2.0)
    unit.inject("home_stuck_open")
    ended(unit)
    assert not unit.ask(AskStatus(0), Status).homed


@pytest.mark.parametrize(("turn", "verdict"), [(HALF_STEPS_PER_TURN, "UNKNOWN"), (64 * 16.032, "BAD")])
def test_a_sensor_that_can_not_turn_freely_still_tells_a_gear_that_is_another_by_far(placed, turn, verdict):
    unit = placed(f"half_steps_per_turn = {turn}")  # stops at 165 degrees
    found = gear.measurement([measured(unit, MeasureKind.TURN)], calibration())
    assert found.Verdict.Name(found.verdict) == f"VERDICT_{verdict}"
    assert ("1/16.032" in found.words) == (verdict == "BAD")


@pytest.mark.parametrize("seed", range(1, 7))
def test_a_motor_that_loses_steps_over_a_turn_is_named(placed, seed):
    unit = placed(f"{FREE}lost_step_probability = 0.001", seed=seed)  # some four slips of eight half steps a turn
    found = gear.measurement([measured(unit, MeasureKind.TURN) for _ in range(2)], calibration())
    assert found.verdict == found.VERDICT_BAD and "loses steps" in found.words


@pytest.mark.parametrize("switch", ["", "home_bounce_ms = 3.0", 'home = "opening_switch"'])
@pytest.mark.parametrize("backlash", [0, 20, 100])
def test_play_is_what_one_edge_differs_by_from_both_sides(placed, switch, backlash):
    kind = HomeKind.OPENING_SWITCH if "opening" in switch else HomeKind.SWITCH
    unit = placed(f"{switch}\nbacklash_deg = {backlash * HALF_STEP_DEG}", home=kind)
    passes = [measured(unit, MeasureKind.PLAY) for _ in range(3)]
    found = play.measurement(passes, calibration(kind))
    assert found.value == pytest.approx(backlash, abs=2)
    assert found.verdict == (found.VERDICT_BAD if backlash else found.VERDICT_GOOD)
    assert ("calibrate --backlash-half-steps" in found.words) == bool(backlash)


def test_a_round_comes_home_where_it_left_it_and_lost_steps_show(placed):
    unit = placed()
    sound = Edges.of(measured(unit, MeasureKind.ROUND))
    assert sound.up[0] - sound.down[-1] == 1  # opened and closed are a half step apart
    assert sound.top - sound.up[0] == pytest.approx(292 / 360 * HALF_STEPS_PER_TURN, abs=60)  # it began below the edge
    unit.inject("motor_loses_steps", probability=0.002)
    lost = [Edges.of(measured(unit, MeasureKind.ROUND)) for _ in range(3)]  # as many up as down, but not thrice
    assert max(abs(each.up[0] - each.down[-1]) for each in lost) >= 7


@pytest.mark.parametrize(
    ("fault", "outcome"),
    [
        ({"kind": "home_stuck_open"}, Measured.NO_SWITCH),
        ({"kind": "home_stuck_closed"}, Measured.STAYS_CLOSED),
        ({"kind": "motor_stuck"}, Measured.NO_SWITCH),
    ],
    ids=lambda value: value["kind"] if isinstance(value, dict) else "",
)
@pytest.mark.parametrize("kind", [MeasureKind.PLAY, MeasureKind.TURN, MeasureKind.ROUND])
def test_what_can_not_be_measured_ends_in_time_with_its_reason_and_the_motor_off(placed, fault, outcome, kind):
    unit = placed()
    unit.inject(**fault)
    assert measured(unit, kind).outcome == outcome


@pytest.mark.parametrize("after_s", [0.5, 6.0, 25.0])
def test_a_switch_that_fails_on_the_way_ends_the_measurement_too(placed, after_s):
    unit = placed(FREE)
    assert unit.command(Measure(0, MeasureKind.TURN)) == Outcome.DONE
    unit.run(after_s)
    unit.inject("home_stuck_open")
    found = ended(unit)
    assert gear.measurement([found], calibration()).verdict != 1  # VERDICT_GOOD


def test_a_stop_ends_a_measurement_and_the_unit_homes_again(placed):
    unit = placed(FREE)
    assert unit.command(Measure(0, MeasureKind.TURN)) == Outcome.DONE
    unit.wait_for_state(State.MEASURING)
    unit.run(2.0)
    assert unit.command(Stop(0)) == Outcome.DONE
    assert ended(unit).outcome == Measured.STOPPED
    assert not unit.ask(AskStatus(0), Status).homed


def test_no_sweep_is_made_meanwhile_and_a_start_waits_for_the_end(placed):
    unit = placed()
    assert unit.command(Measure(0, MeasureKind.PLAY)) == Outcome.DONE
    unit.wait_for_state(State.MEASURING)
    assert unit.command(Single(0)) == unit.command(Measure(0, MeasureKind.PLAY)) == Outcome.BUSY
    assert unit.command(Configure(0, 0, 0, 1, 29, 600, 100, 0, 1)) == unit.command(calibration()) == Outcome.BUSY
    assert unit.command(Start(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.SWEEPING)
    unit.receive(Sweep, 60.0)
    assert unit.ask(AskMechanics(0), Mechanics).outcome == Measured.DONE
    assert unit.command(Measure(0, MeasureKind.PLAY)) == Outcome.BUSY


def test_a_unit_with_a_stop_refuses_what_needs_a_switch(placed):
    unit = placed('home = "none"', home=HomeKind.STOP)
    kinds = (MeasureKind.PLAY, MeasureKind.TURN, MeasureKind.ROUND, 4)
    assert {unit.command(Measure(0, kind)) for kind in kinds} == {Outcome.OUT_OF_RANGE}
    assert measured(unit, MeasureKind.PING).outcome == Measured.DONE


@pytest.mark.parametrize("lag_ms", [0.45, 2.3, 12.3, 42.0])
def test_a_ping_tells_the_lag_and_the_width_of_its_echo(placed, lag_ms):
    unit = placed(sensor=f"echo_lag_ms = {lag_ms}")
    found = measured(unit, MeasureKind.PING)
    assert found.lag / TICKS_PER_MS == pytest.approx(lag_ms, abs=0.03)  # 25 us of trigger
    assert found.width < 40 * TICKS_PER_MS


@pytest.mark.parametrize("no_echo_ms", [38.0, 130.0])
def test_a_ping_without_echo_tells_the_sensors_own_time_out(placed, no_echo_ms):
    unit = placed(sensor=f"no_echo_ms = {no_echo_ms}")
    unit.inject("sensor_deaf")
    assert measured(unit, MeasureKind.PING).width / TICKS_PER_MS == pytest.approx(no_echo_ms, abs=0.1)


def test_an_echo_that_never_rises_or_never_falls_is_told_so(placed):
    unit = placed(sensor="no_echo_ms = 1e9")
    unit.inject("sensor_missing")
    found = measured(unit, MeasureKind.PING)
    assert (found.lag, found.width) == (NEVER, NEVER)
    unit.inject("sensor_deaf")
    found = measured(unit, MeasureKind.PING)
    assert found.lag / TICKS_PER_MS == pytest.approx(0.45, abs=0.03)
    assert found.width == NEVER


def test_a_ping_that_is_stopped_moves_nothing_and_leaves_the_unit_homed(placed):
    unit = placed()
    assert unit.command(Home(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    unit.inject("sensor_missing")  # so that it takes 80 ms
    assert unit.command(Measure(0, MeasureKind.PING)) == unit.command(Stop(0)) == Outcome.DONE
    states = [unit.receive(Status).state]
    while states[-1] != State.IDLE:
        states.append(unit.receive(Status).state)
    assert states == [State.MEASURING, State.IDLE]
    assert unit.ask(AskMechanics(0), Mechanics).outcome == Measured.STOPPED
    assert unit.ask(AskStatus(0), Status).homed


@pytest.mark.parametrize("after_s", [0.1, 0.3, 0.38])  # the line is waited for, the power is cut, the sensor starts
def test_a_sensor_has_its_power_again_after_a_ping_that_was_stopped(placed, after_s):
    unit = placed(sensor="no_echo_ms = 1e9\npower_switch = true")
    for order in (Home(0), GoTo(0, 0)):  # before the wall
        assert unit.command(order) == Outcome.DONE
        unit.wait_for_state(State.IDLE)
    unit.inject("sensor_deaf")
    assert measured(unit, MeasureKind.PING).width == NEVER  # latched: the second of these cuts the power
    assert unit.command(Measure(0, MeasureKind.PING)) == Outcome.DONE
    unit.run(after_s)
    assert unit.command(Stop(0)) == Outcome.DONE
    unit.inject("mended")
    assert ended(unit).outcome == Measured.STOPPED
    found = measured(unit, MeasureKind.PING)
    assert found.lag / TICKS_PER_MS == pytest.approx(0.45, abs=0.03)
    assert found.width / TICKS_PER_MS == pytest.approx(2 * 1.0 / 343.42 * 1000, abs=0.1)  # the wall's


def test_the_supply_is_told_by_the_reference(placed):
    # 3.3 V over 2.38 to 2.50 V: firmware/simulator/README.md
    assert 160 <= measured(placed(), MeasureKind.PING).supply <= 200
