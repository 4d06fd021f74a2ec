"""What the firmware uses of the chip, by the linker's report and measured in the simulator, and what it may use.

Fails when a limit is exceeded. Times are those of a slow chip (each jump misses the prefetch engine's bytes, flash
takes the datasheet's longest), and a factor of 1.5 is kept in reserve on top. There are two runs: a unit that sweeps
without a pause and is acknowledged, and the worst case (worst_case.py), in which the limits of stack, rounds and
interrupts hold too.
"""

import argparse
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

try:
    from worst_case import worst_case
except ModuleNotFoundError as error:
    raise SystemExit(
        f"{error.name} is missing: `make setup` installs it into .venv, whose bin must be first on the PATH"
    ) from None

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
RESERVE = 1.5  # of time
LATENCY = Budget("interrupts: longest wait", round(10 / RESERVE, 1), "us")
ROUND_LIMIT_US = round(16_320 / 3 / RESERVE)  # a third of what the watchdog allows
WORK = Budget("longest work before the watchdog is fed", ROUND_LIMIT_US, "us")
TASKS = (
    *("receive_task", "unit_task", "echo_task", "motor_task", "delivery_task", "transmit_task"),
    *("turns_task", "surveyor_task", "thermometer_task", "confirmation_task"),
)
ROUNDS = {
    "round": Budget("longest round of all tasks", ROUND_LIMIT_US, "us"),
    **{task: Budget(f"longest: {task}", ROUND_LIMIT_US, "us") for task in TASKS},
}
IDLE = Budget("time asleep while sweeping", 100 - 3 / RESERVE, "%", at_least=True)
# What the simulator's speed hangs on.
INSTRUCTIONS = Budget("instructions while sweeping", 178_000, "a second")


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
    fixed = ["--exact-clocks", "--acknowledge", "--speed", "max", "--duration", str(duration_s)]
    command = ["noctule-sim", "--firmware", image, *fixed, *options]
    try:
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout
    except FileNotFoundError:
        raise SystemExit(
            "noctule-sim is missing: `make setup` builds it into .venv/bin, which must be on the PATH"
        ) from None


def instructions(report: str, duration_s: int) -> float:
    """How many have been run in all."""
    return float(found(r"([\d.]+) million instructions/s, 0 resets", report, "noctule-sim")) * 1e6 * duration_s


def longest(name: str, measured: str) -> float:
    """The longest run of a routine, in us."""
    return float(found(rf", {name} (\d+) us", measured, "noctule-sim --measure"))


def longest_wait(measured: str) -> float:
    """Of an interrupt, in us."""
    waits = re.findall(r"([\d.]+) us", measured.partition(", longest of")[0])
    return max(map(float, waits))


def usage(build: Path) -> dict[Budget, float]:
    report = build / "application.mem"
    stack_start = int(found(r"Stack starts at: (0x\w+)", report.read_text(), report), 16)
    image = build / "noctule.ihx"
    started, ran = (instructions(simulated(image, run_s), run_s) for run_s in (START_S, RUN_S))
    timed = routines(build / "application.map")
    usual = found(r"(stack to .*)", simulated(image, RUN_S, "--slowest-chip", "--measure", *timed), "noctule-sim")
    worst, work_us = worst_case(image, *timed)
    stack_top = max(int(found(r"stack to (0x\w+)", measured, measured), 16) for measured in (usual, worst))
    return {
        LOADER: size_of("ROM/EPROM/FLASH", build / "loader.mem"),
        CODE: size_of("ROM/EPROM/FLASH", report),
        XRAM: size_of("EXTERNAL RAM", report),
        IRAM: stack_start,
        STACK: stack_top + 1 - stack_start,
        STACK_LEFT: STACK_END - stack_top,
        LATENCY: max(longest_wait(usual), longest_wait(worst)),
        IDLE: float(found(r"idle ([\d.]+) %", usual, usual)),
        INSTRUCTIONS: round((ran - started) / (RUN_S - START_S)),
        WORK: work_us,
        **{budget: max(longest(name, usual), longest(name, worst)) for name, budget in ROUNDS.items()},
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
