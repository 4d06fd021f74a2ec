"""The unit checks its bearings against home every few sweeps: it says by how much they were off, and corrects them."""

from math import degrees
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import (
    NO_SLIP,
    AskMechanics,
    AskStatus,
    Calibrate,
    Configure,
    GoTo,
    Home,
    HomeKind,
    Mechanics,
    Outcome,
    Start,
    State,
    Status,
    Stop,
    Sweep,
)

EVERY, EVERY_AGAINST_STOP, AFTER_SLIP = 10, 30, 2  # firmware/README.md, "The check of the bearings"
HALF_STEPS_PER_TURN = 25792 / 405 * 64
HALF_STEP_DEG = 360 / HALF_STEPS_PER_TURN
PLAN = Configure(0, -24576, 8192, 7, 29, 600, 100, 0, 1)  # -135 to 135 degrees by 45
CORRECTED_DEG = 1.0


@pytest.fixture
def unit():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        yield unit


def begin(unit: SteppedUnit, backlash: int = 0, home: HomeKind = HomeKind.SWITCH, home_deg: float = -150.0) -> None:
    calibration = Calibrate(0, round(HALF_STEPS_PER_TURN * 256), backlash, home, round(home_deg * 65536 / 360))
    assert unit.command(calibration) == unit.command(PLAN) == unit.command(Start(0, 0)) == Outcome.DONE


def sweeps(unit: SteppedUnit, count: int) -> list[Sweep]:
    made = []
    for _ in range(count):
        made.append(unit.receive(Sweep, within_s=60.0))
        unit.acknowledge(made[-1])
    return made


def error_deg(unit: SteppedUnit) -> float:
    """By how much the sensor looks beside where the unit believes."""
    unit.run(0.5)
    assert unit.command(Stop(0)) == Outcome.DONE
    while unit.ask(AskStatus(0), Status).state != State.IDLE:
        unit.run(0.1)
    assert unit.command(GoTo(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    return degrees(unit.truth["bearing_rad"])


def slip_deg(unit: SteppedUnit) -> float:
    slip = unit.ask(AskMechanics(0), Mechanics).slip
    assert slip != NO_SLIP
    return slip * 360 / 65536


def test_a_sound_unit_looks_for_home_every_ten_sweeps_and_finds_no_slip(unit):
    begin(unit)
    made = sweeps(unit, 4 * EVERY + 1)
    assert not any(one.slipped or one.suspect_before for one in made)
    status = unit.ask(AskStatus(0), Status)
    assert status.mechanics_number == 5  # the first homing, and a check after each ten sweeps
    assert not status.slipped
    assert abs(slip_deg(unit)) <= 3 * HALF_STEP_DEG


@pytest.mark.parametrize("seed", range(1, 6))
def test_lost_steps_are_told_and_corrected_to_a_degree_by_the_next_check(seed):
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        unit.greet()
        begin(unit)
        sweeps(unit, 3)
        unit.inject("motor_loses_steps", probability=0.002, for_s=15.0)
        wrong = sweeps(unit, EVERY - 3)
        (first, *rest) = sweeps(unit, 6)
        # 15 s hold some 6,000 half steps and so some twelve slips of 0.7 degrees, up and down.
        assert not any(one.slipped for one in wrong)
        assert (first.slipped, first.suspect_before) == (True, EVERY)
        assert [one.slipped for one in rest] == [True, False, False, False, False]
        assert not any(one.suspect_before for one in rest)
        assert abs(error_deg(unit)) <= CORRECTED_DEG


@pytest.mark.parametrize("by_deg", [-6.0, 6.0, 25.0])
@pytest.mark.parametrize("backlash", [0, 20, 100])
def test_the_slip_is_told_by_its_size_and_its_sense(tmp_path: Path, by_deg, backlash):
    room = tmp_path / "room.toml"
    wall = "[[wall]]\nfrom_m = [1.0, -9.0]\nto_m = [1.0, 9.0]\n"
    motor = f"[motor]\nbacklash_deg = {backlash * HALF_STEP_DEG}\n"
    room.write_text(f'name = "slip"\n{motor}{wall}[unit]\nposition_m = [0.0, 0.0]\n')
    with stepped_unit("--room", str(room)) as unit:
        unit.greet()
        begin(unit, backlash)
        sweeps(unit, 3)
        unit.inject("sensor_turned", by_deg=by_deg)
        sweeps(unit, EVERY - 3)
        assert sweeps(unit, 1)[0].suspect_before == EVERY
        # Turned up by hand, the sensor looks higher than the unit believes: its bearings were too low.
        assert slip_deg(unit) == pytest.approx(-by_deg, abs=4 * HALF_STEP_DEG)
        assert abs(error_deg(unit)) <= CORRECTED_DEG


def test_a_motor_that_goes_on_losing_steps_is_checked_every_other_sweep_and_all_its_sweeps_say_so(unit):
    begin(unit)
    unit.inject("motor_loses_steps", probability=0.002)
    made = sweeps(unit, EVERY + 12)[EVERY:]
    assert all(one.slipped for one in made)
    assert [one.suspect_before for one in made[::AFTER_SLIP]] == [EVERY] + 5 * [AFTER_SLIP]


def test_a_unit_with_a_stop_meets_it_again_every_thirty_sweeps_and_corrects_what_it_can_not_tell(tmp_path: Path):
    room = tmp_path / "room.toml"
    wall = "[[wall]]\nfrom_m = [1.0, -9.0]\nto_m = [1.0, 9.0]\n"
    motor = '[motor]\nhome = "none"\nstop_deg = 160.0\n'
    room.write_text(f'name = "stop"\n{motor}{wall}[unit]\nposition_m = [0.0, 0.0]\n')
    with stepped_unit("--room", str(room)) as unit:
        unit.greet()
        begin(unit, home=HomeKind.STOP, home_deg=-160.0)
        sweeps(unit, 3)
        unit.inject("sensor_turned", by_deg=12.0)
        sweeps(unit, EVERY_AGAINST_STOP - 3)
        made = sweeps(unit, 2)
        assert not any(one.slipped or one.suspect_before for one in made)
        assert unit.ask(AskMechanics(0), Mechanics).slip == NO_SLIP
        assert abs(error_deg(unit)) <= CORRECTED_DEG


def test_a_switch_that_breaks_is_named_at_the_next_check_and_the_motor_rests(unit):
    begin(unit)
    sweeps(unit, 5)
    unit.inject("home_stuck_open")
    sweeps(unit, EVERY - 5)
    status = unit.wait_for_state(State.FAULT)
    assert (status.fault, status.homed) == (1, False)  # firmware/README.md, STATUS: no home switch found
    unit.run(1.0)
    assert not unit.truth["coils_on"]


def come_to_rest(unit: SteppedUnit) -> int:
    """Stop the unit, and take the sweeps that it still makes: how many."""
    assert unit.command(Stop(0)) == Outcome.DONE
    while unit.ask(AskStatus(0), Status).state != State.IDLE:
        unit.run(0.1)
    return len(sweeps(unit, unit.ask(AskStatus(0), Status).sweeps_waiting))


def test_sweeps_that_a_homing_found_wrong_are_told_after_a_second_homing_that_finds_no_slip(unit):
    begin(unit)
    unit.receive(Sweep, 60.0)
    unit.inject("sensor_turned", by_deg=6.0)
    unit.run(3.0)
    made = come_to_rest(unit)
    for slip in (-6.0, 0.0):
        assert unit.command(Home(0)) == Outcome.DONE
        unit.wait_for_state(State.IDLE)
        assert slip_deg(unit) == pytest.approx(slip, abs=4 * HALF_STEP_DEG)
    assert unit.command(Start(0, 0)) == Outcome.DONE
    first, second = sweeps(unit, 2)
    assert (first.slipped, first.suspect_before) == (True, made)
    assert (second.slipped, second.suspect_before) == (False, 0)


def test_a_sweep_that_was_stopped_before_its_first_ping_is_not_counted(unit):
    begin(unit)
    made = len(sweeps(unit, 2)) + come_to_rest(unit)
    assert unit.command(GoTo(0, 0)) == Outcome.DONE  # far from the first reading
    unit.wait_for_state(State.IDLE)
    for _ in range(5):
        assert unit.command(Start(0, 0)) == unit.command(Stop(0)) == Outcome.DONE
        assert come_to_rest(unit) == 0
    unit.inject("sensor_turned", by_deg=6.0)
    assert unit.command(Home(0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    assert unit.command(Start(0, 0)) == Outcome.DONE
    assert sweeps(unit, 1)[0].suspect_before == made
