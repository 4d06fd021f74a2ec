"""Programs of the project as processes of a test: started, watched, killed, and surely ended."""

import contextlib
import os
import shutil
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import islice
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path
from site import addsitedir
from typing import TypeVar

import psutil

from noctule.ending import CLOSE_VARIABLE

ROOT = Path(__file__).parents[2]
T = TypeVar("T")
PATIENCE_S = 240.0
"""How long a test waits for what a loaded machine may take its time over. It is no promise of the product."""
END_WITHIN_S = 70.0
AS_PROMISED = {CLOSE_VARIABLE: "4"}
"""For the environment of a program that is timed while it ends: the others have a minute (conftest.py)."""
_PAUSE_S = 0.1


class Forked(psutil.Process):
    """A program that was forked: it is watched as one that ``psutil.Popen`` has started."""

    def __init__(self, child: BaseProcess) -> None:
        super().__init__(child.pid)
        self._child = child
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Its exit status, negative for a signal's number; None while it runs."""
        self.returncode = self._child.exitcode
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, when it has ended. Raises TimeoutExpired."""
        self._child.join(timeout)
        if (status := self.poll()) is None:
            raise psutil.TimeoutExpired(timeout or 0.0, self.pid)
        return status


class Programs:
    """The programs that a test has started in the project's folder, each with its output in a file."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._running: dict[str, psutil.Popen | Forked] = {}

    def start(self, name: str, *command: str, env: dict[str, str] | None = None) -> None:
        """Start ``command`` under ``name``; one that ran under that name before must have ended."""
        program = shutil.which(command[0], path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
        assert program is not None, f"{command[0]} is not installed"

        def started(log: Path) -> psutil.Popen:
            with log.open("ab") as output:
                return psutil.Popen(
                    [program, *command[1:]],
                    cwd=ROOT,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    env=os.environ | {"PYTHONUNBUFFERED": "1"} | (env or {}),
                )

        self.take(name, started)

    def take(self, name: str, started: Callable[[Path], psutil.Popen | Forked]) -> None:
        """As start(), for a program that ``started`` starts, with what it prints added to the file that it is given."""
        assert name not in self._running, f"{name} is running already"
        self._running[name] = started(self._log_path(name))

    def kill(self, name: str) -> None:
        """End ``name`` and its children as a power cut would: SIGKILL."""
        process = self._running.pop(name)
        tree = _tree(process)
        for each in tree:
            with contextlib.suppress(psutil.NoSuchProcess):
                each.kill()
        psutil.wait_procs(tree, PATIENCE_S)

    def end(self, name: str) -> int:
        """Ask ``name`` to end (SIGTERM) and return its exit status; fails if it takes too long or leaves children."""
        process = self._running[name]
        tree = _tree(process)
        process.terminate()
        _, alive = psutil.wait_procs(tree, END_WITHIN_S)
        if alive:
            self.kill(name)
            raise AssertionError(f"{END_WITHIN_S:g} s after SIGTERM {alive} of {name} live; its log:\n{self.log(name)}")
        return self.wait(name)

    def log(self, name: str) -> str:
        """What ``name`` has printed so far."""
        return self._log_path(name).read_text(errors="replace")

    def pid(self, name: str) -> int:
        """The process that runs under ``name``."""
        return self._running[name].pid

    def names(self) -> list[str]:
        """Those that were started and not seen to end."""
        return list(self._running)

    def wait(self, name: str) -> int:
        """Wait until ``name`` has ended by itself and return its exit status."""
        status = self._running[name].wait(PATIENCE_S)
        del self._running[name]
        return status

    def runs(self, name: str) -> bool:
        """It was started, and nobody has ended it or seen its end."""
        return name in self._running

    def ended(self) -> dict[str, int]:
        """Those that have ended by themselves since the last call, with their exit status."""
        ended = {name: status for name, process in self._running.items() if (status := process.poll()) is not None}
        for name in ended:
            del self._running[name]
        return ended

    def check(self) -> None:
        """Fail, showing its log, if a program has ended by itself."""
        for name, process in list(self._running.items()):
            assert process.poll() is None, f"{name} ended with {process.returncode}; its log:\n{self.log(name)}"

    def kill_all(self) -> None:
        """Kill whatever a failed test has left running."""
        for name in list(self._running):
            self.kill(name)

    def _log_path(self, name: str) -> Path:
        return self._folder / f"{name}.log"


@contextlib.contextmanager
def programs(folder: Path) -> Iterator[Programs]:
    """The programs of one test, all ended when it is over."""
    started = Programs(folder)
    try:
        yield started
    finally:
        started.kill_all()


def wait_until(condition: Callable[[], T | None], what: str, within_s: float = PATIENCE_S, every_s: float = 0.1) -> T:
    """Call ``condition`` until it is true and return what it gave; fail with ``what`` when time is up."""
    deadline_s = time.monotonic() + within_s
    while not (value := condition()):
        assert time.monotonic() < deadline_s, f"{what} (waited {within_s:g} s)"
        time.sleep(every_s)
    return value


def within_pauses(condition: Callable[[], T | None], what: str, within_s: float) -> T:
    """As wait_until(), for what the product promises: ``within_s`` is the sum of the pauses between two looks, and not
    the clock's. On a loaded machine a pause takes longer, as those of the program under test do.
    """
    for _ in range(round(within_s / _PAUSE_S)):
        if value := condition():
            return value
        time.sleep(_PAUSE_S)
    raise AssertionError(f"{what} (after pauses of {within_s:g} s)")


@contextlib.contextmanager
def repeated(act: Callable[[], object], every_s: float = 1.0) -> Iterator[None]:
    """Within the block ``act`` is called every ``every_s`` on a thread of its own, which has ended afterwards."""
    ended = threading.Event()

    def go_on() -> None:
        while not ended.wait(every_s):
            act()

    thread = threading.Thread(target=go_on)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


def two_processes() -> ProcessPoolExecutor:
    """Both processors for what takes minutes. The processes are spawned: one that is forked has its parent's sessions
    of Zenoh without their threads, and hangs when it collects one as garbage. To them a test's module is one of the
    package ``tests``, as pytest names it.
    """
    return ProcessPoolExecutor(2, get_context("spawn"), initializer=addsitedir, initargs=(str(ROOT),))


# Below the ports that Linux gives to connections (net.ipv4.ip_local_port_range): a connection could take one of those
# before the program listens on it, even that of a client which tries the port and so connects to itself.
_PORTS, _PORTS_OF_A_PROCESS = range(20_000, 32_000), 200


@cache
def _own_ports() -> tuple[socket.socket, deque[int]]:
    """Ports that only this one of all processes that run tests draws; it holds the port before them until it ends."""
    for first in _PORTS[::_PORTS_OF_A_PROCESS]:
        holder = socket.socket()
        try:
            holder.bind(("127.0.0.1", first))
            return holder, deque(range(first + 1, first + _PORTS_OF_A_PROCESS))
        except OSError:
            holder.close()
    raise AssertionError("other tests have all ports")


def free_ports(count: int) -> Sequence[int]:
    """Ports of 127.0.0.1, in a row, that nothing listens on now; the same ones come again as late as can be."""
    _, ports = _own_ports()
    for _ in range(_PORTS_OF_A_PROCESS):
        drawn = list(islice(ports, count))
        ports.rotate(-count)
        if drawn[-1] == drawn[0] + count - 1 and all(map(_is_free, drawn)):
            return drawn
    raise AssertionError(f"no {count} ports in a row are free")


def free_port_range(count: int) -> int:
    """The first of ``count`` such ports."""
    return free_ports(count)[0]


def _is_free(port: int) -> bool:
    with socket.socket() as probe, contextlib.suppress(OSError):
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # as those who listen have it
        probe.bind(("127.0.0.1", port))
        return True
    return False


def listens(port: int) -> bool:
    """Something takes connections on the port."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _tree(process: psutil.Process) -> list[psutil.Process]:
    try:
        return [process, *process.children(recursive=True)]
    except psutil.NoSuchProcess:
        return [process]
