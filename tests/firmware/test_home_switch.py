"""Home switches as they are: contacts that bounce, lines that pick up noise, normally-closed ones, broken wires."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path

import pytest
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import Calibrate, GoTo, Home, Outcome, State, Status

HALF_STEP_DEG = 360 / 4075.7728
HALF_STEPS_PER_TURN = round(25792 / 405 * 64 * 256)
HOME = round(-150 / 360 * 65536)
SWITCH, OPENING_SWITCH = 0, 2
HOME_STAYS_CLOSED = 2  # firmware/README.md, STATUS: fault


@contextmanager
def unit_with(tmp_path: Path, firmware: Path, motor: str, seed: int, home: int = SWITCH) -> Iterator[SteppedUnit]:
    """A unit with this motor and kind of home."""
    room = tmp_path / "room.toml"
    wall = "[[wall]]\nfrom_m = [1.0, -9.0]\nto_m = [1.0, 9.0]\n"
    room.write_text(f'name = "home"\n[motor]\n{motor}\n{wall}[unit]\nposition_m = [0.0, 0.0]\n')
    with stepped_unit("--room", str(room), "--seed", str(seed), image=firmware) as unit:
        unit.greet()
        assert unit.command(Calibrate(0, HALF_STEPS_PER_TURN, 0, home, HOME)) == Outcome.DONE
        yield unit


def home(unit: SteppedUnit) -> Status:
    assert unit.command(Home(0)) == Outcome.DONE
    unit.wait_for_state(State.HOMING)
    while (status := unit.receive(Status, within_s=60)).state == State.HOMING:
        pass
    return status


def error_half_steps(unit: SteppedUnit) -> float:
    """By how much the unit misses its forward direction."""
    assert unit.command(GoTo(0, 0)) == Outcome.DONE
    unit.wait_for_state(State.IDLE)
    return degrees(unit.truth["bearing_rad"]) / HALF_STEP_DEG


@pytest.mark.parametrize("seed", range(1, 7))
@pytest.mark.parametrize(
    ("motor", "kind"),
    [
        ("home_bounce_ms = 0.0", SWITCH),
        ("home_bounce_ms = 3.0", SWITCH),
        ('home = "opening_switch"', OPENING_SWITCH),
        ('home = "opening_switch"\nhome_bounce_ms = 3.0', OPENING_SWITCH),
    ],
)
def test_home_is_found_to_a_few_half_steps(tmp_path, firmware, motor, kind, seed):
    with unit_with(tmp_path, firmware, motor, seed, kind) as unit:
        assert home(unit).homed
        # 3 ms of bounce are two half steps at 600 a second; the rotor and the coils differ by up to four at power-up.
        assert abs(error_half_steps(unit)) <= 4


@pytest.mark.parametrize("seed", range(1, 11))
def test_noise_on_the_line_is_no_home(tmp_path, firmware, seed):
    with unit_with(tmp_path, firmware, "", seed) as unit:
        unit.inject("home_noisy", probability=0.02)
        assert home(unit).homed
        # One look in 50 would have been home within 50 half steps of wherever the motor stood.
        assert abs(error_half_steps(unit)) <= 4


def test_a_broken_wire_of_a_normally_closed_switch_never_winds_up_the_cable(tmp_path, firmware):
    with unit_with(tmp_path, firmware, 'home = "opening_switch"', 1, OPENING_SWITCH) as unit:
        unit.inject("home_stuck_open")
        before_deg = degrees(unit.truth["bearing_rad"])
        assert home(unit).fault == HOME_STAYS_CLOSED
        # Up by a quarter turn, away from the cable's end, and no further.
        assert degrees(unit.truth["bearing_rad"]) - before_deg == pytest.approx(90, abs=1) or (
            degrees(unit.truth["bearing_rad"]) > 160  # it met the stop on the way
        )
