"""Programs forked from a process that has loaded all they need: a start costs a tenth of a second of a processor.

That process (multiprocessing's forkserver) has no threads and nothing open. What is forked calls the function that the
command's script calls; its log, its signals, its children and its exit status are its own.
"""

import atexit
import multiprocessing
import os
import sys
from collections.abc import Sequence
from importlib.metadata import entry_points
from multiprocessing import forkserver
from pathlib import Path
from unittest.mock import patch

from system.histories.host import WallClock
from system.processes import ROOT, Forked

PRELOADED = "system.histories.preload"


class Nursery:
    """Where programs are forked that have the time of ``clock``. One for each process."""

    def __init__(self, clock: WallClock) -> None:
        self.clock = clock
        self._context = multiprocessing.get_context("forkserver")
        self._context.set_forkserver_preload([PRELOADED])
        with patch.dict(os.environ, clock.environment):  # the dynamic linker reads it when that process begins
            forkserver.ensure_running()

    def start(self, command: Sequence[str], log: Path) -> Forked:
        """Start a command of the project, with what it prints added to ``log``."""
        child = self._context.Process(target=_run, args=(list(command), str(log)))
        child.start()
        return Forked(child)


def _run(command: list[str], log: str) -> None:
    (script,) = entry_points(group="console_scripts", name=command[0])
    output = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    for handle in (sys.stdout.fileno(), sys.stderr.fileno()):
        os.dup2(output, handle)
    os.close(output)
    os.chdir(ROOT)
    atexit._clear()  # a program does at its end what itself has registered
    sys.argv = command
    script.load()()
