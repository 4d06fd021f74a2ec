"""The commissioning page, line by line, with the firmware on a motor whose gear and play are not the usual."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from docs.blocks import blocks
from firmware.stepped_unit import SteppedUnit, stepped_unit
from firmware.test_turning import DECREASING, HOMED_DEG, calibrate, go_to, home, looks_at_deg
from system.processes import ROOT

from noctule_gateway.wire.frames import Outcome, Single, State, Sweep

PAGE = ROOT / "firmware/hardware/commissioning.md"
DEFAULT_TURN = 4075.77  # half steps, as the page has it
TURN, PLAY = 4102.5, 33  # of this motor, neither a default
FORWARD = "home\nnoctule rpc attic u7 go_to --bearing-deg 0"
PROTRACTOR_DEG = 0.25  # the half degree that the page speaks of, to either side
ROOM = f"""
name = "bench"
[motor]
half_steps_per_turn = {TURN}
backlash_deg = {PLAY * 360 / TURN}
[[wall]]
from_m = [2.0, -2.0]
to_m = [2.0, 2.0]
[unit]
position_m = [0.0, 0.0]
heading_deg = 0.0
"""


@pytest.fixture
def unit(tmp_path: Path, firmware: Path) -> Iterator[SteppedUnit]:
    (tmp_path / "room.toml").write_text(ROOM)
    with stepped_unit("--room", str(tmp_path / "room.toml"), image=firmware) as started:
        started.greet()
        yield started


def typed(unit: SteppedUnit, containing: str) -> list[float]:
    """Type the page's block that contains this; where the pointer stands after each line, in degrees."""
    block = next(block.text for block in blocks(PAGE) if containing in block.text)
    pointer = []
    for line in block.splitlines():
        match line.removeprefix("noctule rpc attic u7 ").split():
            case ["home"]:
                home(unit)
            case ["go_to", "--bearing-deg", bearing]:
                go_to(unit, float(bearing))
            case ["calibrate", "--backlash-half-steps", half_steps]:
                calibrate(unit, backlash=int(half_steps))
            case _:
                raise AssertionError(f"this test can't type {line}")
        pointer.append(looks_at_deg(unit))
    return pointer


def test_the_gear_is_found_to_what_a_protractor_gives(unit: SteppedUnit) -> None:
    *_, third, fourth = typed(unit, "go_to --bearing-deg -147")
    per_degree = DEFAULT_TURN / (fourth - third)
    assert DEFAULT_TURN * 280 / (fourth - third) == pytest.approx(TURN, abs=PROTRACTOR_DEG * per_degree)


def test_the_play_is_found(unit: SteppedUnit) -> None:
    pointer = typed(unit, "--backlash-half-steps 0")
    assert 11.3 * abs(pointer[5] - pointer[3]) == pytest.approx(PLAY, abs=2)  # each place is rounded to a half step


def test_what_is_left_of_forward_is_added_to_home(unit: SteppedUnit) -> None:
    """The page: a degree clockwise of the mark, that is below it, makes -151 of -150."""
    taken_for_home_deg = -152.0  # the simulated switch closes at -150
    calibrate(unit, TURN, PLAY, home_deg=taken_for_home_deg)
    left = typed(unit, FORWARD)[-1]
    calibrate(unit, TURN, PLAY, home_deg=taken_for_home_deg + left)
    assert typed(unit, FORWARD)[-1] == pytest.approx(0.0, abs=HOMED_DEG)


def test_the_first_sweep_after_home_goes_the_other_way(unit: SteppedUnit) -> None:
    """power-up.md, step 7: clockwise until S2 is pressed, then in steps anticlockwise, which is up."""
    assert unit.command(Single(0)) == Outcome.DONE
    unit.wait_for_state(State.SWEEPING)
    assert not unit.receive(Sweep, within_s=30).flags & DECREASING
