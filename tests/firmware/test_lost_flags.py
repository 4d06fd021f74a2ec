"""The firmware's time on a chip that loses a flag of the PCA's which goes up while an instruction changes PCA0CN.

Whether silicon does so is not known. The edges of an echo are laid at each clock before and after the counter's wrap
at which the service routine of the one may run while the other comes, and so is the routine that begins to watch for
them.
"""

import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest
from firmware.stepped_unit import stepped_unit
from firmware.test_simulator_chip import PREAMBLE

HAL = Path(__file__).parents[2] / "firmware" / "hal"
RISING, FALLING, WATCHING, RISING_LATE, FALLING_LATE = KINDS = range(5)  # the program's command bytes
# Of timebase.c: a condition, which one of those, what is left without the recovery, and the runs that need it.
RECOVERIES = {
    "a wrap while watching begins": ("after < before", 1, "0", [WATCHING]),
    "a wrap while an edge is served": ("after < before", 2, "0", [RISING, FALLING]),
    "an edge while a wrap is served": ("PCA0CPL0 != low || PCA0CPH0 != high", 1, "0", [RISING_LATE, FALLING_LATE]),
    "an edge 256 counts after another": (" || PCA0CPH0 != high", 1, "", [FALLING_LATE]),
}
COUNTS = 90  # of 12 clocks each, from an edge to the wrap: the routine is over by then
RUN_S = 200.0  # of simulated time, some 90 ms for each of them

PROGRAM = """
/* Tells for each command byte in how many runs time or width was wrong: 0 rising edge before the wrap, 1 falling,
   2 watching, 3 rising edge after the wrap, 4 falling. */
uint16_t lead[2];

void shift(uint8_t clocks) {
    switch (clocks) {
    case 11: __asm__("nop");
    case 10: __asm__("nop");
    case 9: __asm__("nop");
    case 8: __asm__("nop");
    case 7: __asm__("nop");
    case 6: __asm__("nop");
    case 5: __asm__("nop");
    case 4: __asm__("nop");
    case 3: __asm__("nop");
    case 2: __asm__("nop");
    case 1: __asm__("nop");
    }
}

void pass(uint16_t turns) { volatile uint16_t left = turns; while (left) left--; }

void sleep(uint8_t wraps) { timebase_wraps = 0; EA = 1; while (timebase_wraps < wraps) PCON |= 1; }

void set_count(uint16_t count) {
    EA = 0;
    CR = 0;
    PCA0L = count; PCA0H = count >> 8;
    CF = 0;
    timebase_wraps = 0;
    CR = 1;
}

/* One ping; whether it was heard with the right width. */
uint8_t ping(uint16_t count, uint8_t clocks) {
    uint16_t width;
    sleep(4);
    set_count(count);
    timebase_watch_edges();
    EA = 1;
    shift(clocks);
    P1_1 = 1; pass(60); P1_1 = 0;
    while (timebase_edges() != 2 && timebase_wraps < 3);
    pass(200);
    width = timebase_edge(1) - timebase_edge(0);
    return width > 23290 && width < 23300;
}

uint8_t watch(uint16_t count, uint8_t clocks) {
    set_count(count);
    shift(clocks);
    timebase_watch_edges();
    EA = 1;
    pass(100);
    return 1;
}

void main(void) {
    start();
    timebase_start();
    ping(0, 0);
    lead[0] = timebase_edge(0); lead[1] = timebase_edge(1);
    for (;;) {
        uint8_t what = receive(), counts, clocks;
        uint16_t wrong = 0;
        for (counts = 0; counts < COUNTS; counts += STEP)
            for (clocks = 0; clocks != 12; clocks++)
            {
                uint8_t heard;
                if (what == 2) heard = watch(-4 - counts, clocks);
                else if (what < 2) heard = ping(-lead[what] - counts, clocks);
                else heard = ping(counts - lead[what - 3], clocks);
                if (!heard || timebase_wraps != 1)
                    wrong++;
            }
        EA = 0;
        send(1 + (wrong & 0x7F)); send(1 + (wrong >> 7)); send(0); /* the end of a frame, for the simulator */
    }
}
"""

# Echoes of 91 * 256 counts, mostly: the low bytes of both edges are alike.
ROOM = """
name = 'wall'
air_temperature_c = 20.0
[sensor]
lobe = [{ range_m = 0.0, half_angle_deg = 179.0 }]
[[wall]]
from_m = [1.00004, -3.0]
to_m = [1.00004, 3.0]
[unit]
position_m = [0.0, 0.0]
"""


def wrong_runs(folder: Path, timebase: str, *faults: str, kinds: Sequence[int] = KINDS, step: int = 1) -> list[int]:
    """How many of the runs of each kind, at each ``step``-th count, went wrong with this source for hal/timebase.c."""
    (folder / "room.toml").write_text(ROOM)
    program = PROGRAM.replace("COUNTS", str(COUNTS)).replace("STEP", str(step))
    (folder / "program.c").write_text(PREAMBLE + timebase + program)
    memory = ["--xram-size", "4096", "--iram-size", "256"]
    command = [
        "sdcc",
        "-mmcs51",
        "--std-sdcc11",
        f"-I{HAL}",
        *memory,
        folder / "program.c",
        "-o",
        folder / "program.ihx",
    ]
    subprocess.run(command, check=True, cwd=folder)
    with stepped_unit("--room", str(folder / "room.toml"), image=folder / "program.ihx") as unit:
        for fault in faults:
            unit.inject(fault)
        unit.step(until_s=0.5)
        wrong = []
        for kind in kinds:
            unit.send_bytes(bytes([kind]))
            low, high, _ = unit.step(until_s=unit.now_s + RUN_S, stop_at_frame=True)
            wrong.append(low - 1 + (high - 1 << 7))
    return wrong


@pytest.mark.parametrize("faults", [[], ["pca_loses_flags"]], ids=["sound", "loses flags"])
def test_no_wrap_and_no_edge_is_lost(tmp_path: Path, faults: list[str]) -> None:
    """In 5400 places of wrap and edge."""
    assert wrong_runs(tmp_path, (HAL / "timebase.c").read_text(), *faults) == [0] * len(KINDS)


@pytest.mark.parametrize("recovery", RECOVERIES)
def test_each_recovery_is_needed(tmp_path: Path, recovery: str) -> None:
    condition, which, instead, kinds = RECOVERIES[recovery]
    parts = (HAL / "timebase.c").read_text().split(condition)
    careless = condition.join(parts[:which]) + instead + condition.join(parts[which:])
    assert wrong_runs(tmp_path, careless, kinds=kinds, step=3) == [0] * len(kinds)
    assert all(wrong > 0 for wrong in wrong_runs(tmp_path, careless, "pca_loses_flags", kinds=kinds, step=3))
