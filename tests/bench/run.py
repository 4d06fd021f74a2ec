"""`make bench`: what the parts can do, as ratios measured in this run. Nothing is passed or failed here."""

import re
import subprocess

SIMULATOR = ("noctule-sim", "--acknowledge", "--speed", "max", "--firmware", "firmware/build/noctule.ihx")


def simulator_speed(units: int, duration_s: float) -> float:
    """Simulated seconds, of all units together, per second on one core; every sweep acknowledged, none missed."""
    command = [*SIMULATOR, "--units", str(units), "--duration", str(duration_s)]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    missed = sum(map(int, re.findall(r"(\d+) missed", output)))
    found = re.search(r"([\d.]+) times real time", output)
    if found is None or missed:
        raise SystemExit(f"the simulator said:\n{output}")
    return float(found[1])


def main() -> None:
    rows = [
        ("one simulated unit, sweeping and acknowledged, against real time", simulator_speed(1, 3600.0)),
        ("20 simulated units in one process, against real time", simulator_speed(20, 180.0)),
    ]
    for what, ratio in rows:
        print(f"{ratio:9.1f}  {what}", flush=True)


if __name__ == "__main__":
    main()
