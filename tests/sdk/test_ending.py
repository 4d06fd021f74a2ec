"""A process that is asked to end has ended within 5 s, whatever of it hangs."""

import signal
import subprocess
import sys
import time

import pytest

WITHIN_S = 5.0

# A mutex that is locked twice waits for ever, in C, where no signal ends the wait. PyDLL keeps Python's lock meanwhile.
HANG = """
import ctypes
mutex = ctypes.create_string_buffer(64)
def hang(library):
    library.pthread_mutex_lock(mutex)
    library.pthread_mutex_lock(mutex)
"""
BEGIN = (
    HANG
    + """
import atexit, logging, sys, threading
from noctule.ending import Ending
ending = Ending()
print("up", flush=True)
"""
)


def ended(program: str, number: signal.Signals = signal.SIGTERM) -> tuple[int, float]:
    """The exit status of ``program`` and how long after the signal it came. Nobody reads its standard error."""
    process = subprocess.Popen(
        [sys.executable, "-c", BEGIN + program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        process.send_signal(number)
        asked_s = time.monotonic()
        return process.wait(30), time.monotonic() - asked_s
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_one_that_closes_in_time_ends_with_its_own_status(number: signal.Signals) -> None:
    status, took_s = ended("ending.begun.wait(); sys.exit(3)", number)
    assert status == 3 and took_s < 2


@pytest.mark.parametrize(
    "program",
    [
        pytest.param("hang(ctypes.CDLL(None))", id="its main thread"),
        pytest.param("ending.begun.wait(); hang(ctypes.CDLL(None))", id="its clean-up"),
        pytest.param("ending.begun.wait(); hang(ctypes.PyDLL(None))", id="a call that keeps Python's lock"),
        pytest.param("atexit.register(hang, ctypes.CDLL(None)); ending.begun.wait()", id="the interpreter's end"),
        pytest.param(
            "threading.Thread(target=hang, args=[ctypes.CDLL(None)]).start(); ending.begun.wait()", id="a thread"
        ),
        pytest.param(
            "while True: logging.warning('x' * 1_000_000)",
            id="its log, which nobody reads",
        ),
    ],
)
def test_one_of_which_something_hangs_ends_with_status_1(program: str) -> None:
    status, took_s = ended(program)
    assert status == 1 and took_s < WITHIN_S


def test_what_did_not_close_is_said_in_the_log() -> None:
    program = BEGIN + "import os, signal; os.kill(os.getpid(), signal.SIGTERM); hang(ctypes.CDLL(None))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr == "not closed within 4 s: ended as it is; nothing stored is lost\n"
