"""The demo's supervisor: pauses before it starts something again, stubborn processes, and stopped terminals."""

import os
import pty
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
from system.processes import PATIENCE_S, ROOT, wait_until


@contextmanager
def kept(*commands: str, stdout: int = subprocess.PIPE) -> Iterator[psutil.Popen]:
    """Shell commands c0, c1 ... under the supervisor."""
    environment = os.environ | {"PYTHONPATH": str(ROOT / "deploy/demo")}
    script = str(Path(__file__).with_name("kept.py"))
    process = psutil.Popen([sys.executable, script, *commands], stdout=stdout, env=environment, text=True)
    try:
        yield process
    finally:
        for each in [process, *process.children(recursive=True)] if process.is_running() else []:
            with suppress(psutil.NoSuchProcess):
                each.kill()
        process.wait()


def test_what_ends_at_once_is_started_again_after_growing_pauses() -> None:
    begun_s = time.monotonic()
    with kept("exit 3") as process:
        lines = [process.stdout.readline() for _ in range(3)]
        elapsed_s = time.monotonic() - begun_s
    assert lines == [f"demo | c0 ended with status 3; started again in {pause} s\n" for pause in (1, 2, 4)]
    assert elapsed_s > 3.0


def test_a_child_that_its_dead_parent_left_is_ended_before_the_parent_is_started_again() -> None:
    with kept("sleep 1000 & echo $!; exit 1") as process:
        pid = int(process.stdout.readline().split("|")[1])
        assert "c0 ended with status 1" in process.stdout.readline()
        wait_until(lambda: not psutil.pid_exists(pid), "the child lives on")


def test_a_process_that_does_not_end_by_itself_is_killed() -> None:
    with kept("trap '' TERM; echo up; while true; do sleep 1; done", "echo up; exec sleep 1000") as process:
        assert [process.stdout.readline().split("|")[1] for _ in range(2)] == [" up\n"] * 2
        children = process.children(recursive=True)
        process.terminate()
        assert process.wait(PATIENCE_S) == 0
        assert process.stdout.read() == "demo | c0 did not end by itself and is killed\n"
        _, alive = psutil.wait_procs(children, PATIENCE_S)
        assert not alive


def test_processes_are_ended_in_the_opposite_order_of_their_start() -> None:
    says_when_it_ends = "trap 'echo over; exit' TERM; echo up; while true; do sleep 0.1; done"
    with kept(says_when_it_ends, says_when_it_ends, says_when_it_ends) as process:
        for _ in range(3):
            assert "up" in process.stdout.readline()
        process.terminate()
        assert process.stdout.read().splitlines() == [f"c{number}   | over" for number in (2, 1, 0)]


def test_a_terminal_that_takes_nothing_holds_up_no_process(tmp_path: Path) -> None:
    done = tmp_path / "done"
    window, stdout = pty.openpty()
    try:
        with kept(f"seq 200000; touch {done}; exec sleep 1000", stdout=stdout) as process:
            os.close(stdout)
            wait_until(done.exists, "the process waits for the terminal")
            process.terminate()
            assert process.wait(PATIENCE_S) == 0
    finally:
        os.close(window)
