"""A process that is asked to end has ended within 5 s, whatever of it hangs, and a program whatever its threads do."""

import signal
import subprocess
import sys
import time
from importlib.metadata import entry_points

import pytest
from system.processes import PATIENCE_S

from noctule import ending

WITHIN_S = 5.0
BUSY_WITHIN_S = 25.0  # by the clock of a machine that does much else
# The kernel's signal is the last resort: who is starved for 0.3 s ends by it, and not with status 1.
PATIENT = "from noctule import ending as its\nits._KILLED_AFTER_S = 60.0\n"

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


@pytest.fixture(autouse=True)
def as_users_have_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(ending.CLOSE_VARIABLE, raising=False)


def ended(program: str, number: signal.Signals = signal.SIGTERM) -> tuple[int, float]:
    """The exit status of ``program`` and how long after the signal it came. Nobody reads its standard error."""
    process = subprocess.Popen(
        [sys.executable, "-c", PATIENT + BEGIN + program], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None and process.stdout.readline() == "up\n"
        process.send_signal(number)
        asked_s = time.monotonic()
        return process.wait(PATIENCE_S), time.monotonic() - asked_s
    finally:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_one_that_closes_in_time_ends_with_its_own_status(number: signal.Signals) -> None:
    status, took_s = ended("ending.begun.wait(); sys.exit(3)", number)
    assert status == 3 and took_s < BUSY_WITHIN_S


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
    assert status == 1 and took_s < BUSY_WITHIN_S


def test_the_last_resort_comes_within_the_time_that_is_promised() -> None:
    assert ending._LOG_WITHIN_S < ending._KILLED_AFTER_S
    assert ending.close_within_s() + ending._KILLED_AFTER_S < WITHIN_S


@pytest.mark.parametrize(("text", "seconds", "warns"), [("90", 90.0, False), ("0", 4.0, True), ("long", 4.0, True)])
def test_a_slow_host_gives_more_time(
    text: str, seconds: float, warns: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv(ending.CLOSE_VARIABLE, text)
    assert ending.close_within_s() == seconds
    assert (f"is {text!r} and not a number of seconds from 1 to 600: it is 4 s" in caplog.text) is warns


def test_what_did_not_close_is_said_in_the_log() -> None:
    # A process that others starve for half a second ends without a word; this one has longer.
    patient = "from noctule import ending as its\nits._LOG_WITHIN_S = its._KILLED_AFTER_S = 60.0\n"
    program = patient + BEGIN + "import os, signal; os.kill(os.getpid(), signal.SIGTERM); hang(ctypes.CDLL(None))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert done.returncode == 1
    assert done.stderr == "not closed within 4 s: ended as it is; nothing stored is lost\n"


# Zenoh's threads call Python for each sample, and never let it rest: without end_with() the interpreter's end waits for
# them without end.
SAMPLES_COME = """
import threading, time, zenoh
alone = '{mode: "peer", scouting: {multicast: {enabled: false}}, listen: {endpoints: []}}'
session = zenoh.open(zenoh.Config.from_json5(alone))
came = threading.Event()
subscriber = session.declare_subscriber("noise", lambda _: came.set())
def flood():
    while True:
        session.put("noise", b"x")
threading.Thread(target=flood, daemon=True).start()
came.wait()
"""
PROGRAMS = ("noctule", "noctule-deploy", "noctule-gateway", "noctule-mapper", "noctule-viewer")


def run(program: str) -> subprocess.CompletedProcess[str]:
    """A process that never ends is killed, which raises."""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=240)


def _script(name: str) -> list[str]:
    """Module and function that a command's script calls."""
    (script,) = entry_points(group="console_scripts", name=name)
    return script.value.split(":")


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_ends_though_native_threads_want_the_interpreter(name: str) -> None:
    module, function = _script(name)
    call = f"import sys\nfrom {module} import {function}\nsys.argv = ['{name}', '--version']\n{function}()"
    done = run(SAMPLES_COME + call)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{name} ")


@pytest.mark.parametrize("name", PROGRAMS)
def test_ctrl_c_while_a_program_is_loaded_ends_it_without_a_word(name: str) -> None:
    module, function = _script(name)
    done = run(
        "import os, signal, sys\n"
        "class CtrlC:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'typer':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, CtrlC())\n"
        f"from {module} import {function}\n{function}()"
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_a_program_that_was_started_without_ctrl_c_stays_without_it() -> None:
    done = run(
        "import signal, sys\n"
        "signal.signal(signal.SIGINT, signal.SIG_IGN)\n"
        "from noctule.starting import start\n"
        "sys.stopped = lambda: print(signal.getsignal(signal.SIGINT) == signal.SIG_IGN)\n"
        "start('sys', 'stopped')"
    )
    assert (done.stdout, done.stderr) == ("True\n", "")


@pytest.mark.parametrize(
    ("program", "status", "said"),
    [
        ("pass", 0, ""),
        ("sys.exit()", 0, ""),
        ("sys.exit(3)", 3, ""),
        ("sys.exit('it is broken')", 1, "it is broken\n"),
        ("raise KeyboardInterrupt", 130, ""),
        ("raise ValueError('no number')", 1, "ValueError: no number"),
    ],
)
def test_a_program_has_the_status_that_python_gives_and_loses_no_output(program: str, status: int, said: str) -> None:
    done = run(
        "import atexit, logging, logging.handlers, sys\n"
        "from noctule.ending import end_with\n"
        "atexit.register(print, 'at exit')\n"
        "late = logging.handlers.MemoryHandler(100, target=logging.StreamHandler())\n"
        "logging.basicConfig(level='INFO', handlers=[late])\n"
        "logging.info('a line that is still held')\n"
        "print('printed')\n"
        f"def program():\n    {program}\n"
        "end_with(program)"
    )
    assert done.returncode == status
    assert said in done.stderr and done.stderr.count("a line that is still held") == 1
    assert said or done.stderr == "a line that is still held\n"
    assert done.stdout == "printed\nat exit\n"


def test_ctrl_c_while_a_library_is_loaded_is_no_failure_to_report() -> None:
    done = run(
        "from noctule.ending import end_with\n"
        "def program():\n"
        "    raise ImportError('initialization failed') from KeyboardInterrupt()\n"  # as pybind11 has it
        "end_with(program)"
    )
    assert (done.returncode, done.stderr) == (130, "")


def test_output_for_which_the_disk_has_no_room_is_no_success() -> None:
    done = run(
        "import sys; from noctule.ending import end_with\n"
        "sys.stdout = open('/dev/full', 'w')\n"
        "end_with(lambda: print('lost'))"
    )
    assert done.returncode == 120
