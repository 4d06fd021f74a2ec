"""The unit starts soundly whatever its supply does: any rise, dips of any depth (firmware/README.md, Supply)."""

import subprocess
from itertools import count, pairwise
from pathlib import Path
from random import Random

import pytest
from firmware.images import built_with_fault
from firmware.small_programs import Run
from firmware.stepped_unit import SteppedUnit, stepped_unit

from noctule_gateway.wire.frames import AskSettings, Loader, Outcome, Settings, Store, TrimTemperature

# RSTSRC's bits (Silicon Labs' SI_C8051F340_Register_Enums.h)
PINRSF, PORSF, FERROR = 0x01, 0x02, 0x40
HAL = Path(__file__).parents[2] / "firmware" / "hal"
# From nothing to 3.3 V; Silicon Labs asks for 1 ms at most.
RISES_MS = (0.01, 0.1, 1.0, 10.0, 100.0, 1000.0)
DIPS = (0, 0, 1, 3, 10, 40)
# The supply is off for 0.1 s, rises, and is unsteady for 0.6 s; then the loader looks at the application for 0.4 s.
STARTED_WITHIN_S = 1.5


def trimmed(unit: SteppedUnit) -> Settings:
    """The settings of a unit that has stored its own."""
    unit.greet()
    unit.run(3.0)
    assert unit.command(TrimTemperature(0, 2150)) == Outcome.DONE
    assert unit.command(Store(0)) == Outcome.DONE
    return unit.ask(AskSettings(0), Settings)


def start_with_ramps(seed: int, ramps: int) -> None:
    """Take a unit through so many power-ups: each is counted, and it keeps its settings."""
    random = Random(seed)
    with stepped_unit("--laps", "0", "--seed", str(seed)) as unit:
        settings = trimmed(unit)
        boots = [unit.greet_again().boot]
        for ramp in count(1):
            rise_ms, dips = random.choice(RISES_MS), random.choice(DIPS)
            unit.inject("power_ramp", rise_ms=rise_ms, dips=dips)
            unit.run(rise_ms / 1e3 + STARTED_WITHIN_S)
            hello = unit.greet_again()
            assert hello.reset_cause == PORSF, (ramp, rise_ms, dips)
            boots.append(hello.boot)
            found = unit.ask(AskSettings(0), Settings)
            assert found.temperature_trim == settings.temperature_trim and found.stored, (ramp, rise_ms, dips)
            if ramp == ramps:
                break
        assert all(later > earlier for earlier, later in pairwise(boots))


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_unit_starts_soundly_after_any_rise_of_its_supply(seed):
    start_with_ramps(seed, 40)


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(101, 111))
def test_a_unit_starts_soundly_after_thousands_of_rises(seed):
    start_with_ramps(seed, 200)


def is_harmed(unit: SteppedUnit) -> bool:
    """Whether slow rises spoil the flash: the loader refuses the application, or the program runs wild."""
    try:
        for _ in range(30):
            unit.inject("power_ramp", rise_ms=1000.0, dips=0)
            unit.run(1.0 + STARTED_WITHIN_S)
            if unit.take(Loader):
                return True
    except AssertionError as error:
        return "the simulator has ended with status 1" in str(error)
    return False


def test_without_its_guard_a_slow_rise_spoils_the_flash(tmp_path):
    image = built_with_fault(tmp_path, "hal/start_up.c", ("    supply_guard();\n", ""))
    command = ["noctule-sim", "--control", "--laps", "0", "--firmware", image]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert is_harmed(SteppedUnit(process))


WATCHED = f"""
#include "{HAL}/supply.c"
#include "{HAL}/flash.c"

void main(void) {{
    uint8_t cause = RSTSRC;
    start();
    if (cause & {FERROR}) {{ send(cause); send(cause); for (;;); }}
    receive();
    flash_write(0xF400, 0x0F); send(flash_read(0xF400));
    VDM0CN = VDM0CN_VDMEN; wait_us(150); RSTSRC = RSTSRC_PORSF;
    flash_write(0xF400, 0x0F); send(flash_read(0xF400));
    for (;;);
}}
"""


def test_flash_is_written_only_while_the_monitor_says_that_the_supply_is_good(running: Run):
    with running(WATCHED) as board:
        assert board.ask(b"g", 2) == bytes([0xFF, 0x0F])


def test_a_reset_by_its_pin_is_told():
    with stepped_unit("--laps", "0") as unit:
        before = unit.greet().boot
        unit.inject("reset_pin")
        after = unit.greet()
        assert (after.reset_cause, after.boot) == (PINRSF, before + 1)
