"""The Rerun relay: a process of its own that takes what mappers draw and passes it on to all who watch."""

import logging
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from types import FrameType, MappingProxyType
from typing import NoReturn

import rerun_cli

from noctule import metrics, metrics_server, port_holder
from noctule.ending import Ending
from noctule.errors import NoctuleError
from noctule.messages_pb2 import ServiceStatus
from noctule.systemd import ServiceManager
from noctule_viewer import address, page
from noctule_viewer.pulse import Pulse

RERUN = Path(rerun_cli.__file__).with_name("rerun.exe" if sys.platform == "win32" else "rerun")
"""The viewer's own binary: the ``rerun`` on the path is a wrapper that would stand between it and signals."""

# Rerun knows no variable that turns its analytics off, only a file in the user's folder of settings.
_SETTINGS = Path(__file__).with_name("rerun_settings")
# The native viewer also asks for releases and examples, which no option prevents. Data from a relay need no proxy.
_NOWHERE = "http://127.0.0.1:9"  # the discard port
# Rerun's allocator (mimalloc) gives free pages back at once. If it keeps them for a while, as it does by default, a
# full relay goes on growing: tests/bench/relay_memory.py.
GIVES_BACK = {"MIMALLOC_PURGE_DELAY": "0"}
_START_WITHIN_S = 30.0
_LAYOUT_WITHIN_S = 60.0
_END_WITHIN_S = 2.0
_LOOK_AFTER_EVERY_S = 1.0
_LOOK_EVERY_S = 0.05

_log = logging.getLogger(__name__)


class RelayError(NoctuleError):
    """The relay can't be run as asked."""


@dataclass(frozen=True)
class Relay:
    """Where a relay listens. It has no passwords: who reaches it can read and write, so keep it on loopback."""

    bind: str
    port: int
    web_port: int
    memory_limit: str

    @property
    def url(self) -> str:
        """Where mappers and native viewers connect to."""
        return address.url(self.bind, self.port)

    @property
    def page(self) -> str:
        """What to open in a browser."""
        return address.page(self.bind, self.port, self.web_port)

    def check_ports(self) -> None:
        """Raises RelayError if one of the ports can't be had."""
        for port in (self.port, self.web_port):
            with socket.socket() as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                try:
                    probe.bind((self.bind, port))
                except OSError as error:
                    raise RelayError(
                        f"can't listen on {self.bind}:{port}: {port_holder.why_not(error, port)}"
                    ) from error

    def run(
        self,
        serving: Callable[[], AbstractContextManager[object]],
        metrics_at: str | None,
        ending: Ending,
        show: Callable[[ServiceStatus], object] = lambda _: None,
        troubles: Callable[[], Sequence[str]] = tuple,
        drawn_s: Callable[[], float | None] = lambda: None,
    ) -> int:
        """Run the relay and its page, ``serving()`` as soon as both answer and until they end. Returns the relay's exit
        status.

        ``show`` is given the relay's status each second, and must not wait. ``troubles`` and ``drawn_s`` as page.State
        has them.
        SIGTERM and SIGINT end both, and this process with status 0. Raises RelayError if the relay does not start,
        MetricsError if ``metrics_at`` can't be had.
        """
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, _exit)
        files_port = _free_port(self.bind)
        with _process(self._command(files_port)) as relay:
            _wait_until_listening(relay, self.bind, (self.port, files_port))
            self._send_layout()
            pulse, data = Pulse(self.bind, files_port), f"http://{self.bind}:{self.port}"
            state = page.State(lambda: pulse.silent_s, troubles, drawn_s)
            with page.serving((self.bind, self.web_port), (self.bind, files_port), data, state), serving():
                return self._look_after(relay, pulse, metrics_at, ending, show)

    def _look_after(
        self,
        relay: subprocess.Popen[bytes],
        pulse: Pulse,
        metrics_at: str | None,
        ending: Ending,
        show: Callable[[ServiceStatus], object],
    ) -> int:
        """Wait for the relay to end by itself; its exit status. Tell systemd and Prometheus how it fares meanwhile."""
        shown = metrics.registry(lambda: [_status(pulse)], child=lambda: relay.pid)
        manager = ServiceManager()
        with metrics_server.serving(metrics_at, shown):
            try:
                while relay.poll() is None:
                    pulse.feel()
                    show(_status(pulse))
                    manager.serving(f"watch the map at {self.page}", pulse.beats)
                    ending.begun.wait(_LOOK_AFTER_EVERY_S)
            finally:
                manager.stopping()
            return relay.returncode

    def _command(self, files_port: int) -> list[str]:
        # Without a source such as a layout file: with one, Rerun 0.41 keeps a core busy after the source has ended.
        ports = ["--port", str(self.port), "--web-viewer-port", str(files_port)]
        # Who comes late gets the present first, and the past after it.
        kept = ["--server-memory-limit", self.memory_limit, "--newest-first"]
        return [str(RERUN), "--serve-web", "--bind", self.bind, *ports, *kept]

    def _send_layout(self) -> None:
        """Give the relay the layout, which it keeps for viewers that come later."""
        command = [sys.executable, "-m", "noctule_viewer.blueprint", self.url]
        try:
            subprocess.run(
                command, env=environment(), check=True, capture_output=True, text=True, timeout=_LAYOUT_WITHIN_S
            )
        except subprocess.TimeoutExpired:
            _log.warning("the relay did not take the layout: viewers show Rerun's own")
        except subprocess.CalledProcessError as error:
            _log.warning("the layout was not sent, so viewers show Rerun's own: %s", error.stderr.strip())


def environment() -> dict[str, str]:
    """The environment for Rerun's programs: no analytics, no requests to foreign hosts, and only warnings."""
    quiet = {"XDG_CONFIG_HOME": str(_SETTINGS), "ALL_PROXY": _NOWHERE, "NO_PROXY": ""}
    return {"RUST_LOG": "warn"} | os.environ | quiet


def start(
    command: list[str], stderr: int | None = None, settings: Mapping[str, str] = MappingProxyType({})
) -> subprocess.Popen[bytes]:
    """A process that ends when this one is killed, where the system has ``setpriv``.

    ``settings`` are for its environment, where that does not say otherwise.
    """
    setpriv = shutil.which("setpriv")
    bound_to_us = [setpriv, "--pdeathsig", "KILL"] if setpriv else []
    given = {**settings, **environment()}
    return subprocess.Popen([*bound_to_us, *command], env=given, stdin=subprocess.DEVNULL, stderr=stderr)


@contextmanager
def _process(command: list[str]) -> Iterator[subprocess.Popen[bytes]]:
    """The relay's process, which ends with this one, however this one ends."""
    process = start(command, settings=GIVES_BACK)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(_END_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _wait_until_listening(relay: subprocess.Popen[bytes], host: str, ports: tuple[int, ...]) -> None:
    deadline_s = time.monotonic() + _START_WITHIN_S
    while not all(_listens(host, port) for port in ports):
        if relay.poll() is not None:
            raise RelayError(f"the relay ended at its start with status {relay.returncode}: the lines above say why")
        if time.monotonic() > deadline_s:
            raise RelayError(f"the relay did not listen on {host} within {_START_WITHIN_S:g} s: start it again")
        time.sleep(_LOOK_EVERY_S)


def _listens(host: str, port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((host, port)) == 0


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return probe.getsockname()[1]


def _status(pulse: Pulse) -> ServiceStatus:
    status = ServiceStatus(
        name="viewer",
        role="viewer",
        version=version("noctule-viewer"),
        rerun=version("rerun-sdk"),
        detail="" if pulse.beats else "the relay does not answer: start it again",
        counters={"relay_looks": pulse.looks, "relay_looks_failed": pulse.failed},
    )
    status.time.GetCurrentTime()
    return status


def _exit(_number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(0)
