"""What the firmware uses of the chip, by the linker's report and measured in the simulator, and what it may use.

Fails when a limit is exceeded. The measured run is one unit that sweeps without a pause and is acknowledged; a STORE,
which keeps interrupts waiting while flash is written, is not in it.
"""

import argparse
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

STACK_END = 0xFF
RUN_S = 120
START_S = 10  # of the run: the loader looks through the whole application, the unit homes


@dataclass(frozen=True)
class Budget:
    """A row of the table: at most ``limit`` of something, or at least so much."""

    name: str
    limit: float
    unit: str
    at_least: bool = False

    def holds(self, used: float) -> bool:
        return used >= self.limit if self.at_least else used <= self.limit

    def row(self, used: float) -> str:
        verdict = "" if self.holds(used) else "  EXCEEDED"
        bound = "at least" if self.at_least else "at most"
        return f"{self.name:<42}{used:>8g} of {bound} {self.limit:>6g} {self.unit}{verdict}"


# The one table of limits. README.md, Flash, has the pages of code, and Layout what the margins are for.
LOADER = Budget("code: loader", 0x1000, "bytes")
CODE = Budget("code: application", 0x7FE0 - 0x1000, "bytes")
XRAM = Budget("XRAM: variables (the ring has the rest)", 0x0400, "bytes")
IRAM = Budget("IRAM: registers and variables", 120, "bytes")
STACK = Budget("IRAM: stack, the deepest measured", 112, "bytes")
STACK_LEFT = Budget("IRAM: left above it", 24, "bytes", at_least=True)
LATENCY = Budget("interrupts: longest wait", 10, "us")
# A third of the watchdog's 16.3 ms; and the simulator has no prefetch misses, for which a factor of 1.5 is kept.
ROUND_LIMIT_US = round(16_320 / 3 / 1.5)
TASKS = (
    *("receive_task", "unit_task", "echo_task", "motor_task", "delivery_task", "transmit_task"),
    *("turns_task", "surveyor_task", "thermometer_task", "confirmation_task"),
)
ROUNDS = {
    "round": Budget("longest round of all tasks", ROUND_LIMIT_US, "us"),
    **{task: Budget(f"longest: {task}", ROUND_LIMIT_US, "us") for task in TASKS},
}
IDLE = Budget("time asleep while sweeping", 97, "%", at_least=True)
# What the simulator's speed hangs on.
INSTRUCTIONS = Budget("instructions while sweeping", 184_000, "a second")


def found(pattern: str, text: str, source: object) -> str:
    match = re.search(pattern, text)
    if match is None:
        raise SystemExit(f"{source} does not say what budget.py looks for: {pattern}")
    return match[1]


def size_of(memory: str, report: Path) -> int:
    """A memory's used bytes in the linker's report (name, start, end, size, maximum)."""
    return int(found(rf"{memory} +(?:0x\w+ +0x\w+ +)?(\d+) +\d+", report.read_text(), report))


def address_of(name: str, symbols: Path) -> str:
    """Where a function begins, by the linker's map."""
    return found(rf"C: +(\w+) +_{name} ", symbols.read_text(), symbols)[-4:]


def routines(symbols: Path) -> list[str]:
    """The options of ``noctule-sim`` that time a round of the main loop, and each of its tasks."""
    tasks = [f"{task}={address_of(task, symbols)}" for task in TASKS]
    whole = f"round={address_of('watchdog_feed', symbols)}-{address_of('round_wait', symbols)}"
    return [option for routine in [whole, *tasks] for option in ("--routine", routine)]


def simulated(image: Path, duration_s: int, *options: str) -> str:
    """What ``noctule-sim`` says at the end."""
    command = ["noctule-sim", "--firmware", image, "--acknowledge", "--speed", "max", "--duration", str(duration_s)]
    try:
        return subprocess.run([*command, *options], check=True, capture_output=True, text=True).stdout
    except FileNotFoundError:
        raise SystemExit(
            "noctule-sim is missing: `make setup` builds it into .venv/bin, which must be on the PATH"
        ) from None


def instructions(report: str, duration_s: int) -> float:
    """How many have been run in all."""
    return float(found(r"([\d.]+) million instructions/s, 0 resets", report, "noctule-sim")) * 1e6 * duration_s


def usage(build: Path) -> dict[Budget, float]:
    report = build / "application.mem"
    stack_start = int(found(r"Stack starts at: (0x\w+)", report.read_text(), report), 16)
    image = build / "noctule.ihx"
    started, ran = simulated(image, START_S), simulated(image, RUN_S, "--measure", *routines(build / "application.map"))
    line = found(r"(stack to .*)", ran, "noctule-sim --measure")
    sweeping = instructions(ran, RUN_S) - instructions(started, START_S)
    stack_top = int(found(r"stack to (0x\w+)", line, line), 16)
    return {
        LOADER: size_of("ROM/EPROM/FLASH", build / "loader.mem"),
        CODE: size_of("ROM/EPROM/FLASH", report),
        XRAM: size_of("EXTERNAL RAM", report),
        IRAM: stack_start,
        STACK: stack_top + 1 - stack_start,
        STACK_LEFT: STACK_END - stack_top,
        LATENCY: max(float(wait_us) for wait_us in re.findall(r"([\d.]+) us", line.partition(", longest of")[0])),
        IDLE: float(found(r"idle ([\d.]+) %", line, line)),
        INSTRUCTIONS: round(sweeping / (RUN_S - START_S)),
        **{budget: float(found(rf", {name} (\d+) us", line, line)) for name, budget in ROUNDS.items()},
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("build", type=Path, help="the folder with the image and the linker's report")
    used = usage(parser.parse_args().build)
    for budget, amount in used.items():
        print(budget.row(amount))
    if not all(budget.holds(amount) for budget, amount in used.items()):
        sys.exit("a limit is exceeded: make the firmware smaller, or the limit in budget.py greater if there is room")


if __name__ == "__main__":
    main()
