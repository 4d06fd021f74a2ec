"""How little the CPU of an idle unit works: noctule-sim counts the instructions. budget.py counts them in sweeps."""

import re
import subprocess
from pathlib import Path

FIRMWARE = Path(__file__).parents[2] / "firmware"
START_S = 10
SIMULATED_S = 60
IDLE = ("--laps", "0", "--tcp", "127.0.0.1:0")


def millions_of_instructions(duration_s: int) -> float:
    image = FIRMWARE / "build" / "noctule.ihx"
    command = [
        "noctule-sim",
        "--exact-clocks",
        "--firmware",
        image,
        "--speed",
        "max",
        "--duration",
        str(duration_s),
        *IDLE,
    ]
    report = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rate = re.search(r"([\d.]+) million instructions/s, 0 resets", report)
    assert rate
    return float(rate[1]) * duration_s


# firmware/README.md, Layout: millions of instructions/s, and a little more for rounding
MOST_WHILE_IDLE = 0.075


def test_the_cpu_sleeps_when_it_has_nothing_to_do():
    subprocess.run(["make", "-C", FIRMWARE], check=True, capture_output=True)
    # The loader looks through the whole application before it starts that: what two runs have in common is left out.
    started, ran = (millions_of_instructions(duration_s) for duration_s in (START_S, START_S + SIMULATED_S))
    assert 0 < (ran - started) / SIMULATED_S < MOST_WHILE_IDLE
