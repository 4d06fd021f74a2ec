"""How fast the simulator runs, against real time."""

import re
import subprocess

COMMAND = ("noctule-sim", "--acknowledge", "--speed", "max", "--firmware", "firmware/build/noctule.ihx")


def speed(units: int, duration_s: float) -> float:
    """Simulated seconds, of all units together, per second on one core; every sweep acknowledged, none missed."""
    command = [*COMMAND, "--units", str(units), "--duration", str(duration_s)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    missed = sum(map(int, re.findall(r"(\d+) missed", output)))
    found = re.search(r"([\d.]+) times real time", output)
    if found is None or missed:
        raise SystemExit(f"the simulator said:\n{output}")
    return float(found[1])
