"""The firmware keeps within the chip: what `make size` checks, and the stack after all that a host can ask for."""

import re
import shutil
import subprocess
from pathlib import Path

from firmware.stepped_unit import stepped_unit
from firmware.update_rig import Update

from noctule_gateway.update.outcome import Updated
from noctule_gateway.wire.frames import (
    AskClock,
    AskHello,
    AskSettings,
    AskStatus,
    Calibrate,
    Clock,
    Configure,
    GoTo,
    Hello,
    Home,
    Outcome,
    Settings,
    Single,
    Start,
    State,
    Status,
    Stop,
    Store,
    Sweep,
    TrimTemperature,
)

FIRMWARE = Path(__file__).parents[2] / "firmware"
# firmware/README.md, Layout
STACK_RESERVE_BYTES = 24


def size(folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["make", "--no-print-directory", "-C", folder, "size"], capture_output=True, text=True)


def test_every_budget_is_kept():
    report = size(FIRMWARE)
    assert report.returncode == 0, report.stdout + report.stderr
    rows = report.stdout.splitlines()
    for name in (
        "code: loader",
        "code: application",
        "XRAM",
        "IRAM",
        "stack",
        "interrupts",
        "asleep",
        "instructions",
        "work",
    ):
        assert any(name in row for row in rows), name


def test_each_budget_that_is_not_kept_fails(tmp_path):
    script = (FIRMWARE / "budget.py").read_text()
    too_strict = [
        (r'(CODE = Budget\(".*", )[^"]+(, "bytes"\))', "100"),
        (r'(IDLE = Budget\(".*", )[^"]+(, "%", at_least=True\))', "99.99"),
        (r'(INSTRUCTIONS = Budget\(".*", )[^"]+(, "a second"\))', "100"),
        (r'("round": Budget\(".*", )[^"]+(, "us"\))', "100"),
        (r'(WORK = Budget\(".*", )[^"]+(, "us"\))', "100"),
        (r'(LATENCY = Budget\(".*", )[^"]+(, "us"\))', "1"),
    ]
    for limit, figure in too_strict:
        script, changes = re.subn(limit, lambda found, figure=figure: f"{found[1]}{figure}{found[2]}", script)
        assert changes == 1, limit
    (tmp_path / "budget.py").write_text(script)
    shutil.copy(FIRMWARE / "worst_case.py", tmp_path)
    report = subprocess.run(["python3", tmp_path / "budget.py", FIRMWARE / "build"], capture_output=True, text=True)
    assert report.returncode == 1
    assert report.stdout.count("EXCEEDED") == len(too_strict)


def test_the_stack_keeps_its_reserve_whatever_a_host_asks_for():
    with stepped_unit("--laps", "0") as unit:
        unit.greet()
        unit.run(3.0)
        orders = [
            Calibrate(0, 1043398, 5, 0, -27307),
            Configure(0, -24576, 4096, 13, 60, 600, 100, 20, 5),
            TrimTemperature(0, 2000),
            Store(0),
            Home(0),
        ]
        for order in orders:
            assert unit.command(order) == Outcome.DONE
        unit.wait_for_state(State.IDLE)
        assert unit.command(GoTo(0, 9000)) == Outcome.DONE
        unit.wait_for_state(State.IDLE)
        assert unit.command(Start(0, 0)) == Outcome.DONE
        for _ in range(5):
            for enquiry, answer in [
                (AskHello(0), Hello),
                (AskStatus(0), Status),
                (AskClock(0), Clock),
                (AskSettings(0), Settings),
            ]:
                unit.ask(enquiry, answer)
            unit.acknowledge(unit.receive(Sweep, 60.0))
        assert unit.command(Stop(0)) == Outcome.DONE
        unit.wait_for_state(State.IDLE)
        assert unit.command(Single(0)) == Outcome.DONE
        left = unit.ask(AskStatus(0), Status).stack_free
        assert left >= STACK_RESERVE_BYTES


def test_on_the_slowest_chip_the_loader_works_for_a_third_of_the_watchdogs_time_at_most(new_image):
    # firmware/loader/chip.h: 65 ms, of which the erase of a page takes 20
    with stepped_unit("--laps", "0", "--slowest-chip") as unit:
        unit.greet()
        update, operations, longest_work_us = Update(unit, new_image), 0, 0.0
        while (outcome := update.run(until_operation=operations)) is None:
            operations = unit.truth["flash_operations"] + 1
            longest_work_us = max(longest_work_us, unit.truth["longest_work_us"])
        assert isinstance(outcome, Updated)
        assert 20_000 < longest_work_us < 65_280 / 3
