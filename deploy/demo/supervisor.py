"""Keep processes running: start again what ends, and leave nothing behind however the supervisor itself ends.

Each process leads a session of its own, so a terminal's Ctrl-C or hang-up reaches only the supervisor, which then ends
them in order. If the supervisor is killed, the kernel kills them (PR_SET_PDEATHSIG). The signal is sent when the thread
that started a process ends, so only the main thread may start one.
"""

import contextlib
import ctypes
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence

Say = Callable[[str, str], None]
"""Print a line: whose it is, and its text."""

SUPERVISOR = "demo"
_LOOK_EVERY_S = 0.1
_FIRST_PAUSE_S, _LONGEST_PAUSE_S = 1.0, 30.0
_LASTING_S = 10.0  # a process that ran for longer is started again without a longer pause
_END_WITHIN_S = 5.0  # all processes together; then they are killed
_DRAIN_WITHIN_S = 1.0
_PR_SET_PDEATHSIG = 1
_LIBC = ctypes.CDLL(None)


def end_with_parent() -> None:
    """Have the kernel send this process SIGTERM when its parent ends, as it would if the parent passed it on."""
    parent = os.getppid()
    _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGTERM)


def supervise(
    commands: Mapping[str, Sequence[str]], environment: Mapping[str, str], stop: threading.Event, say: Say
) -> None:
    """Run the ``commands`` by name until ``stop`` is set; then end them, last started first."""
    processes = [_Process(name, command, environment, say) for name, command in commands.items()]
    try:
        while not stop.wait(_LOOK_EVERY_S):
            for process in processes:
                process.attend()
    finally:
        by_s = time.monotonic() + _END_WITHIN_S
        for process in reversed(processes):
            process.end(by_s)


class _Process:
    """One process, its output, and when to start it again."""

    def __init__(self, name: str, command: Sequence[str], environment: Mapping[str, str], say: Say) -> None:
        self._name, self._command, self._environment, self._say = name, command, environment, say
        self._running: subprocess.Popen[bytes] | None = None
        self._reader = threading.Thread()
        self._started_s = 0.0
        self._due_s = 0.0
        self._pause_s = _FIRST_PAUSE_S

    def attend(self) -> None:
        """Start the process when it is due; when it has ended, say so and make it due again."""
        now_s = time.monotonic()
        if self._running is None:
            if now_s >= self._due_s:
                self._start(now_s)
        elif (status := self._running.poll()) is not None:
            self._kill_group()
            self._running = None
            if now_s - self._started_s > _LASTING_S:
                self._pause_s = _FIRST_PAUSE_S
            self._say(SUPERVISOR, f"{self._name} {_ending(status)}; started again in {self._pause_s:g} s")
            self._due_s = now_s + self._pause_s
            self._pause_s = min(2 * self._pause_s, _LONGEST_PAUSE_S)

    def end(self, by_s: float) -> None:
        """Ask the process to end, and kill what is left of it at ``by_s``."""
        if self._running is None:
            return
        self._running.terminate()
        try:
            self._running.wait(max(by_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._say(SUPERVISOR, f"{self._name} did not end by itself and is killed")
        self._kill_group()
        self._running.wait()
        self._reader.join(_DRAIN_WITHIN_S)

    def _start(self, now_s: float) -> None:
        supervisor = os.getpid()

        def die_with_the_supervisor() -> None:
            _LIBC.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
            if os.getppid() != supervisor:  # it ended before the line above
                os._exit(1)

        self._running = subprocess.Popen(
            self._command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=self._environment,
            start_new_session=True,
            preexec_fn=die_with_the_supervisor,
        )
        self._started_s = now_s
        self._reader = threading.Thread(target=self._pass_on, args=(self._running,), daemon=True)
        self._reader.start()

    def _pass_on(self, running: subprocess.Popen[bytes]) -> None:
        assert running.stdout is not None
        for line in running.stdout:
            self._say(self._name, line.decode(errors="replace").rstrip())

    def _kill_group(self) -> None:
        """Kill the process and the children that it has left: they may hold its ports."""
        assert self._running is not None
        with contextlib.suppress(ProcessLookupError):  # nothing of it is left
            os.killpg(self._running.pid, signal.SIGKILL)


def _ending(status: int) -> str:
    return f"was ended by {signal.Signals(-status).name}" if status < 0 else f"ended with status {status}"
