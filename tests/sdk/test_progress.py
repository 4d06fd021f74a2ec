"""The line that says how far a command is, on a terminal."""

import os
import pty
import select
import subprocess
import sys

from system.processes import PATIENCE_S

COMMAND = """
import logging, sys, time
from noctule.logs import StderrHandler
from noctule.progress import progress
logging.basicConfig(handlers=[StderrHandler()])
with progress() as shown:
    {steps}
    sys.stdin.readline()
    logging.warning("a warning")
    time.sleep(0.5)
"""


def on_a_terminal(steps: str, count: str) -> str:
    """What a command that takes these steps, and waits until its line says ``count``, writes on its terminal."""
    main, far_end = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "100"}
    command = [sys.executable, "-c", COMMAND.format(steps=steps)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=far_end, env=environment) as it:
        assert it.stdin is not None
        os.close(far_end)
        shown = ""
        while True:
            if count in shown:
                it.stdin.close()
            assert select.select([main], [], [], PATIENCE_S)[0], f"nothing comes after {shown!r}"
            try:
                part = os.read(main, 65536)
            except OSError:  # the other end is closed
                break
            shown += part.decode()
    os.close(main)
    assert it.returncode == 0, shown
    return shown


def test_steps_of_a_known_number_are_counted_of_it_others_alone() -> None:
    assert "3/7" in on_a_terminal('shown.at("mapping", 3, 7)', "3/7")
    counted = on_a_terminal('shown.at("publishing", 1234)', " 1234 ")
    assert " 1234 " in counted and "1234/" not in counted and "/?" not in counted


def test_a_warning_has_a_line_of_its_own_above() -> None:
    lines = on_a_terminal('shown.at("mapping", 3, 7)', "3/7").split("\n")
    (warning,) = [line for line in lines if "a warning" in line]
    assert "mapping" not in warning.rpartition("\x1b[2K")[2]
