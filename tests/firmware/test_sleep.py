"""How much of the time the CPU works: noctule-sim counts the instructions of the real firmware."""

import re
import subprocess
from pathlib import Path

import pytest

FIRMWARE = Path(__file__).parents[2] / "firmware"
START_S = 10
SIMULATED_S = 60


def millions_of_instructions(duration_s: int, arguments: list[str]) -> float:
    image = FIRMWARE / "build" / "noctule.ihx"
    command = ["noctule-sim", "--firmware", image, "--speed", "max", "--duration", str(duration_s), *arguments]
    report = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rate = re.search(r"([\d.]+) million instructions/s, 0 resets", report)
    assert rate
    return float(rate[1]) * duration_s


@pytest.mark.parametrize(
    ("arguments", "most"),
    [
        # firmware/README.md, Layout: millions of instructions/s, and a tenth more for homing and rounding
        pytest.param(["--acknowledge"], 0.184, id="sweeping"),
        pytest.param(["--laps", "0", "--tcp", "127.0.0.1:0"], 0.075, id="idle"),
    ],
)
def test_the_cpu_sleeps_when_it_has_nothing_to_do(arguments, most):
    subprocess.run(["make", "-C", FIRMWARE], check=True, capture_output=True)
    # The loader looks through the whole application before it starts that: what two runs have in common is left out.
    started, ran = (millions_of_instructions(duration_s, arguments) for duration_s in (START_S, START_S + SIMULATED_S))
    assert 0 < (ran - started) / SIMULATED_S < most
