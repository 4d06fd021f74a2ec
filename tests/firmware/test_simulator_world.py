"""The simulator's world as the real firmware meets it: rooms, the air, the motor, and what goes wrong on demand."""

import math
from itertools import pairwise

import pytest
from firmware.small_rooms import (
    BEARINGS_PER_TURN,
    SPEED_OF_SOUND_M_S,
    STARE,
    UNIT,
    WALL,
    range_m,
    refusal,
    stare,
    unit_in,
)
from firmware.stepped_unit import SilenceError

from noctule_gateway.wire.frames import (
    AskStatus,
    Configure,
    Hello,
    Home,
    NoEcho,
    Single,
    Start,
    State,
    Status,
    Sweep,
)

pytestmark = pytest.mark.usefixtures("firmware")


# Parts that break. The kinds of no echo: firmware/README.md, "Unit to host".


@pytest.mark.parametrize(
    ("kind", "seen"),
    [
        ("sensor_deaf", NoEcho.NO_ECHO),
        ("sensor_short_pulse", NoEcho.TOO_EARLY),
        ("sensor_too_early", NoEcho.TOO_EARLY),
        ("sensor_stuck_high", NoEcho.STUCK_HIGH),
        ("sensor_missing", NoEcho.NO_SENSOR),
    ],
)
def test_what_is_wrong_with_the_sensor_is_in_every_reading_until_it_is_mended(tmp_path, kind, seen):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": kind})
        assert stare(unit) == [seen] * 5
        unit.step(fault={"kind": "mended"})
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([2.0] * 5, abs=1e-3)


@pytest.mark.parametrize("kind", ["motor_stuck", "home_stuck_open"])
def test_a_unit_that_cannot_home_says_so(tmp_path, kind):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": kind})
        unit.command(Home(0))
        assert unit.wait_for_state(State.FAULT).fault == 1


def test_a_held_button_is_a_press_and_the_truth_knows_of_it(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.step(fault={"kind": "button_held", "for_s": 0.2})
        assert unit.truth["button_pressed"] and unit.truth["led_lit"]
        unit.receive(Sweep, 60)
        assert not unit.truth["button_pressed"]


def test_nothing_is_lost_over_a_cable_that_was_pulled(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.command(Single(0))
        unit.step(fault={"kind": "cable_pulled", "for_s": 30})
        with pytest.raises(SilenceError):
            unit.receive(Sweep, 29)
        assert unit.receive(Sweep, 10).sequence == 0


def test_how_a_run_is_stepped_through_changes_nothing_of_what_a_cable_passes(tmp_path):
    def sent(steps: int, *options: str) -> tuple[float, list[bytes]]:
        """When the unit was told to home, and what it has sent within a second of that, by steps."""
        with unit_in(tmp_path, WALL + UNIT, *options) as unit:
            told_s = unit.now_s
            unit.send(Home(9))
            return told_s, [unit.run(1.0 / steps) for _ in range(steps)]

    told_s, parts = sent(2000)
    answered_s = next(step for step, part in enumerate(parts) if part) / 2000
    # The answer and a STATUS are on the line for 4 ms; the cable is plugged in again after the first bytes.
    faults = tmp_path / "faults.toml"
    faults.write_text(f'[[fault]]\nat_s = {told_s}\nkind = "cable_pulled"\nfor_s = {answered_s + 0.0007}\n')
    at_once, in_steps = (b"".join(sent(steps, "--faults", str(faults))[1]) for steps in (1, 1777))
    assert at_once == in_steps
    assert 0 < len(at_once) < len(b"".join(parts))


def test_a_cable_that_garbles_bytes_makes_bad_frames_and_loses_no_sweep(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(STARE)
        unit.command(Start(0, 0))
        unit.step(fault={"kind": "cable_corrupts", "to_unit": 0.02, "to_host": 0.002, "for_s": 60})
        sequences = set()
        while unit.now_s < 70:
            sweep = unit.receive(Sweep, 20)
            unit.acknowledge(sweep)
            sequences.add(sweep.sequence)
        unit.step(fault={"kind": "mended"})
        assert unit.ask(AskStatus(0), Status).frames_bad > 0
        assert sequences == set(range(len(sequences)))


def test_a_power_cut_is_followed_by_a_power_up(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        began = unit.step(fault={"kind": "power_cut", "for_s": 2.0})
        assert began == b""
        cut_at_s = unit.now_s
        hello = unit.receive(Hello, 10)
        assert hello.request == 0
        assert unit.now_s >= cut_at_s + 2.0
        assert unit.truth["resets"] == 1


def test_a_dip_of_the_supply_resets_the_chip_by_its_monitor(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.step(fault={"kind": "brown_out"})
        # RSTSRC.PORSF (C8051F34x data sheet, SFR definition of RSTSRC)
        assert unit.receive(Hello, 10).reset_cause & 0x02


def test_the_power_may_go_in_the_midst_of_a_flash_operation(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 0\nkind = "power_cut_at_flash_operation"\nnumber = 1\n')
    with unit_in(tmp_path, WALL + UNIT, "--faults", str(faults)) as unit:
        # The first boot's was its boot number; it ended there, and the second one went on.
        assert unit.truth["resets"] == 1
        assert unit.truth["flash_operations"] >= 2


def test_faults_of_a_schedule_come_and_go_at_their_times(tmp_path):
    faults = tmp_path / "faults.toml"
    faults.write_text('[[fault]]\nat_s = 3\nunit = 1\nkind = "button_held"\nfor_s = 0.5\n')
    with unit_in(tmp_path, WALL + UNIT, "--faults", str(faults)) as unit:
        pressed = []
        while unit.now_s < 4.0:
            unit.run(0.1)
            pressed.append((round(unit.now_s, 3), unit.truth["button_pressed"]))
    held = [at_s for at_s, is_pressed in pressed if is_pressed]
    assert 3.0 < held[0] < 3.11 and 3.39 < held[-1] <= 3.5


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ('kind = "gremlin"', "gremlin"),
        ('kind = "motor_stuck"\ncolour = "red"', "colour"),
        ('kind = "motor_stuck"\nunit = 2', "unit is none of the units"),
        ('kind = "power_cut"', "for_s"),
        ('kind = "motor_loses_steps"\nprobability = 2', "probability"),
        ('kind = "brown_out"\nfor_s = 2', "for_s"),
    ],
)
def test_a_fault_that_makes_no_sense_is_refused_by_file_and_field(tmp_path, fault, words):
    faults = tmp_path / "faults.toml"
    faults.write_text(f"[[fault]]\nat_s = 1\n{fault}\n")
    told = refusal("--faults", str(faults))
    assert "faults.toml" in told and words in told


# The motor.


def test_the_truth_of_the_bearing_is_what_the_unit_says_but_for_half_a_step(tmp_path):
    with unit_in(tmp_path, WALL + UNIT) as unit:
        unit.command(Home(0))
        unit.wait_for_state(State.IDLE)
        said_rad = unit.ask(AskStatus(0), Status).bearing / BEARINGS_PER_TURN * math.tau
        assert unit.truth["bearing_rad"] == pytest.approx(said_rad, abs=1.5 * math.tau / 4075.77)
        assert not unit.truth["coils_on"]


def test_slack_leaves_the_sensor_behind_by_as_much(tmp_path):
    def turned_deg(backlash_deg: float) -> float:
        """How far the sensor turns when the motor goes to and fro."""
        motor = f"[motor]\nbacklash_deg = {backlash_deg}\n"
        with unit_in(tmp_path, WALL + motor + UNIT, "--seed", "3") as unit:
            unit.command(Home(0))
            unit.wait_for_state(State.IDLE)
            bearings = []
            for bearing in (-16384, 0, -8192):
                unit.command(Configure(0, bearing, 0, 1, 60, 600, 100, 0, 1))
                unit.command(Single(0))
                unit.acknowledge(unit.receive(Sweep, 60))
                bearings.append(unit.truth["bearing_rad"])
            return math.degrees(bearings[1] - bearings[2])

    assert turned_deg(0.0) == pytest.approx(45.0, abs=0.1)
    assert turned_deg(2.0) == pytest.approx(43.0, abs=0.1)


# The room and its air.


def test_an_object_that_moves_is_measured_where_it_is(tmp_path):
    moving = "[[cylinder]]\nradius_m = 0.3\npath = ["
    moving += "{ at_s = 20, center_m = [1.3, 0.0] }, { at_s = 25, center_m = [1.8, 0.0] }]\n"
    with unit_in(tmp_path, moving + UNIT) as unit:
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([1.0] * 5, abs=1e-3)
        unit.run(26 - unit.now_s)
        assert [range_m(echo) for echo in stare(unit)] == pytest.approx([1.5] * 5, abs=1e-3)


def test_warming_air_shortens_the_flight(tmp_path):
    air = "air_temperature_schedule = [{ at_s = 30, temperature_c = 0 }, { at_s = 40, temperature_c = 30 }]\n"
    with unit_in(tmp_path, air + WALL + UNIT) as unit:
        cold = stare(unit)
        assert unit.truth["air_temperature_c"] == 0.0
        unit.run(41 - unit.now_s)
        warm = stare(unit)
        assert unit.truth["air_temperature_c"] == 30.0
    assert cold[0] / warm[0] == pytest.approx((331.3 + 0.606 * 30) / 331.3, abs=1e-4)


def test_pings_faster_than_the_room_goes_quiet_hear_the_last_one(tmp_path):
    lobe = "[sensor]\nlobe = [{ range_m = 0.0, half_angle_deg = 11.25 }]\n"
    wall = "[[wall]]\nfrom_m = [2.6, -3.0]\nto_m = [2.6, 3.0]\n"

    def sweep(reverberation_ms: float) -> Sweep:
        with unit_in(tmp_path, f"{lobe}reverberation_ms = {reverberation_ms}\n{wall}{UNIT}") as unit:
            unit.command(Configure(0, 0, 0, 64, 29, 600, 100, 0, 1))
            unit.command(Single(0))
            return unit.receive(Sweep, 60)

    assert all(range_m(reading.echo) == pytest.approx(2.6, abs=1e-3) for reading in sweep(29.0).readings)
    early = 0
    for before, reading in pairwise(sweep(40.0).readings):
        # To the wall and back twice, less the time from ping to ping; an offset is in 4 us.
        interval_s = (reading.offset - before.offset) * 4e-6
        late_m = 2 * 2.6 - interval_s * SPEED_OF_SOUND_M_S / 2
        early += range_m(reading.echo) == pytest.approx(late_m, abs=2e-3)
        assert range_m(reading.echo) in (pytest.approx(2.6, abs=1e-3), pytest.approx(late_m, abs=2e-3))
    # Every other time of 63.
    assert 16 < early < 47
