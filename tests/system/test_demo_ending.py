"""However the demo is ended it leaves no process and no port behind, and what is killed of it is started again."""

import os
import pty
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest
from system.processes import PATIENCE_S, ROOT, free_ports, listens, wait_until
from system.site import SITE, SURVEY_SWEEPS

from noctule.client import Client

PARTS = ("noctule-sim", "noctule-gateway", "rerun", "noctule-mapper", "truth.py")
# -o: what the demo needs is made already. The shell outlives make, as a user's does: else the kernel hangs up on all.
SHELL = ["sh", "-c", "make -o packages-run -o setup-demo -o firmware-demo demo; exec sleep 1000"]


class Demo:
    """`make demo` in a terminal window of its own."""

    def __init__(self, folder: Path) -> None:
        names = ("UNIT", "ZENOH", "RERUN", "WEB")
        self.ports = dict(zip(names, free_ports(len(names)), strict=True))
        settings = {f"DEMO_{name}_PORT": str(port) for name, port in self.ports.items()}
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        environment = os.environ | settings | {"DEMO_DATA": str(folder / "data"), "PATH": path}
        pid, self._window = pty.fork()
        if pid == 0:
            os.chdir(ROOT)
            os.execvpe(SHELL[0], SHELL, environment)
        self.shell = psutil.Process(pid)
        self.make = wait_until(lambda: next(iter(self.shell.children()), None), "make does not start")
        self.seen: set[psutil.Process] = set()
        self._printed = bytearray()
        self._closing = threading.Event()
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    @property
    def starter(self) -> psutil.Process:
        """The process that the recipe runs."""
        return self.make.children()[0]

    @property
    def printed(self) -> str:
        """What stands in the window."""
        return self._printed.decode(errors="replace")

    def part(self, program: str) -> psutil.Process | None:
        """The process of the demo whose command names ``program``."""
        for process in self.tree():
            with suppress(psutil.Error):
                if any(Path(word).name == program for word in process.cmdline()[:2]):
                    return process
        return None

    def tree(self) -> list[psutil.Process]:
        """All processes of the demo."""
        with suppress(psutil.NoSuchProcess):
            return [self.make, *self.make.children(recursive=True)]
        return []

    def wait_until_begun(self) -> None:
        """Wait until every process has been started."""
        wait_until(lambda: len(self.tree()) >= 2 + len(PARTS), f"not all has begun: {self.tree()}")

    def wait_until_up(self) -> None:
        """Wait until every process runs as what it is, and every port is listened on."""
        wait_until(lambda: all(map(self.part, PARTS)), f"not all of {PARTS} run")
        wait_until(lambda: all(map(listens, self.ports.values())), f"not all of {self.ports} are open")

    def press_ctrl_c(self) -> None:
        os.write(self._window, b"\x03")

    def close_window(self) -> None:
        if not self._closing.is_set():
            self._closing.set()
            self._reader.join()
            os.close(self._window)

    def _read(self) -> None:
        while not self._closing.is_set():
            ready, _, _ = select.select([self._window], [], [], 0.1)
            try:
                self._printed += os.read(self._window, 65536) if ready else b""
            except OSError:  # EIO: no process has the window open
                return


@contextmanager
def demo(folder: Path) -> Iterator[Demo]:
    """A demo that is surely over at the end."""
    started = Demo(folder)
    try:
        yield started
    finally:
        print(started.printed)  # pytest shows it of a test that has failed
        tree = {started.shell} | started.seen | set(started.tree())
        for process in tree:
            with suppress(psutil.NoSuchProcess):
                process.kill()
        started.close_window()
        psutil.wait_procs(tree, PATIENCE_S)


WHILE_PARTS_ARE_STARTING: dict[str, Callable[[Demo], None]] = {
    "SIGTERM": lambda demo: demo.starter.terminate(),
    "kill -9 of make": lambda demo: demo.make.kill(),
}
WHEN_ALL_IS_UP: dict[str, Callable[[Demo], None]] = {
    "the window is closed": Demo.close_window,
    "kill -9 of the starter": lambda demo: demo.starter.kill(),
}


@pytest.mark.parametrize("ending", WHILE_PARTS_ARE_STARTING)
def test_a_demo_that_ends_while_it_starts_leaves_no_process_and_no_port(ending: str, tmp_path: Path) -> None:
    with demo(tmp_path) as running:
        running.wait_until_begun()
        assert_ends_all(running, WHILE_PARTS_ARE_STARTING[ending])


@pytest.mark.parametrize("ending", WHEN_ALL_IS_UP)
def test_a_demo_that_ends_when_all_is_up_leaves_no_process_and_no_port(ending: str, tmp_path: Path) -> None:
    with demo(tmp_path) as running:
        running.wait_until_up()
        assert_ends_all(running, WHEN_ALL_IS_UP[ending])


def test_a_part_that_is_killed_is_started_again_and_ctrl_c_ends_all_without_a_complaint(tmp_path: Path) -> None:
    with demo(tmp_path) as running:
        with Client(SITE, connect=[f"tcp/127.0.0.1:{running.ports['ZENOH']}"]) as client:
            wait_until(lambda: logged(client) >= 2, "no two sweeps")
            before = logged(client)
            assert before < SURVEY_SWEEPS - 1, "too late to see sweeps come after the gateway was killed"
            killed = running.part("noctule-gateway")
            assert killed is not None
            killed.kill()
            wait_until(lambda: mapped(client) > before + 1, "the map does not go on")
        wait_until(lambda: "Watch the map at http" in running.printed, "the address is not printed")
        assert "gateway was ended by SIGKILL; started again in 1 s" in running.printed
        again = running.part("noctule-gateway")
        assert again is not None and again.pid != killed.pid
        wait_until(lambda: "The map is complete" in running.printed, "the truth's watcher is silent")
        assert "truth     | \033[0mno router" not in running.printed

        assert_ends_all(running, Demo.press_ctrl_c)
        wait_until(lambda: "The demo has ended" in running.printed, "it does not say that it has ended")
        last_words = running.printed.split("^C")[-1].lower()
        assert not any(word in last_words for word in ("error", "traceback", "***")), last_words


def test_a_reader_that_ends_after_the_first_line_ends_the_demo_without_a_word_more(tmp_path: Path) -> None:
    names = ("UNIT", "ZENOH", "RERUN", "WEB")
    ports = dict(zip(names, free_ports(len(names)), strict=True))
    environment = os.environ | {f"DEMO_{name}_PORT": str(port) for name, port in ports.items()}
    environment["DEMO_DATA"] = str(tmp_path / "data")
    starter = psutil.Popen(
        [sys.executable, "deploy/demo/run.py"],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    tree: list[psutil.Process] = []
    try:
        wait_until(lambda: len(starter.children()) == len(PARTS), "not all parts run")
        tree = starter.children(recursive=True)
        assert starter.stdout.readline()
        starter.stdout.close()
        assert starter.wait(PATIENCE_S) == 0
        assert starter.stderr.read() == ""
        _, alive = psutil.wait_procs(tree, PATIENCE_S)
        assert not alive
        assert not any(map(listens, ports.values()))
    finally:
        starter.stderr.close()
        for process in [starter, *tree]:
            with suppress(psutil.NoSuchProcess):
                process.send_signal(signal.SIGKILL)
        psutil.wait_procs([starter, *tree], PATIENCE_S)


def assert_ends_all(demo: Demo, ending: Callable[[Demo], None]) -> None:
    demo.seen.update(tree := demo.tree())
    ending(demo)
    _, alive = psutil.wait_procs(tree, PATIENCE_S)
    assert not alive
    assert not any(map(listens, demo.ports.values()))


def logged(client: Client) -> int:
    """How many sweeps the gateway holds."""
    records = client.log("u1", from_sequence=1)
    return 0 if records is None else records.head


def mapped(client: Client) -> int:
    """How many sweeps the newest contour rests on."""
    contour = client.contour()
    return 0 if contour is None else contour.sweeps
