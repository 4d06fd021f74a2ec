"""A fleet on several hosts, each a network namespace that runs what noctule-deploy has rendered for it.

What systemd does for a service here: it starts its command, and starts it again when it has been broken.
"""

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from deploy.namespaces import Network, network
from deploy.rendered_host import RenderedHost
from deploy.secured_fleet import ZENOHD
from system.processes import PATIENCE_S, ROOT, Programs, programs, wait_until
from typer.testing import CliRunner

from noctule.messages_pb2 import Contour, Sweep
from noctule_deploy import cli

T = TypeVar("T")
SITE = "paper-room"
UNITS, DESK = "unit-box", "desk"  # what noctule-deploy renders nothing for: the serial lines' host, the operator's
DOMAIN = "site.example"
ADDRESSES = {
    "hub-1": "10.77.0.1",
    "hub-2": "10.77.0.2",
    "attic-pi": "10.77.0.11",
    "server": "10.77.0.21",
    UNITS: "10.77.0.31",
    DESK: "10.77.0.41",
}
UNIT_PORT = 7101  # of hosts of this network alone
FLEET = f"""
[[router]]
name = "one"
address = "{ADDRESSES["hub-1"]}"
host = "hub-1"
listen = "{ADDRESSES["hub-1"]}"

[[router]]
name = "two"
address = "hub-2.{DOMAIN}"
host = "hub-2"

[[gateway]]
name = "attic"
site = "{SITE}"
units = ["u1"]
host = "attic-pi"
site_file = "paper-room.toml"

[[mapper]]
name = "cartographer"
sites = ["{SITE}"]
host = "server"

[[operator]]
name = "anna"
sites = ["*"]
"""
# What a router says of an address that its host does not have yet: zenohd where there is one, else our own.
NO_ADDRESS = "Cannot assign requested address" if ZENOHD else "does not have the address"


READ_CONTOUR = """
import sys
from noctule.client import Client

with Client(sys.argv[1]) as client:
    if (contour := client.contour()) is not None:
        print(contour.SerializeToString().hex())
"""


class SeveralHosts:
    """The hosts of the fleet, and who is at its desk."""

    def __init__(self, folder: Path, network: Network, running: Programs) -> None:
        self.network, self._folder, self._running = network, folder, running
        self._to_end: set[str] = set()  # services that have been broken, and whose end is not seen yet
        site = (ROOT / "deploy/demo/sites/paper.toml").read_text()
        (folder / "paper-room.toml").write_text(site.replace("127.0.0.1:7101", f"{ADDRESSES[UNITS]}:{UNIT_PORT}"))
        (folder / "fleet.toml").write_text(FLEET)
        made = CliRunner().invoke(cli.app, ["render", *self._fleet()])
        assert made.exit_code == 0, made.output
        self._hosts = {
            each: RenderedHost(folder / "rendered" / each, folder / "hosts" / each)
            for each in ADDRESSES
            if each not in (UNITS, DESK)
        }
        for name, host in self._hosts.items():
            host.install()
            assert host.services(), name
        for name, address in ADDRESSES.items():
            network.add(name, address)

    def boot(self, host: str) -> None:
        """Start the services of a host, or the simulated unit, which listens as a serial server does."""
        if host == UNITS:
            unit = ("noctule-sim", "--firmware", "firmware/build/noctule.ihx", "--room", "paper", "--seed", "7")
            self._start(host, "unit", [*unit, "--exact-clocks", "--speed", "8", "--tcp", f"0.0.0.0:{UNIT_PORT}"], {})
            return
        for service in self._hosts[host].services():
            self._start_service(host, service)

    def cut_power(self, host: str) -> None:
        """A host is off at once: no end of a connection is announced."""
        self.network.pull(host)
        for service in self._hosts[host].services():
            if self._running.runs(service):
                self._running.kill(service)
        self.network.take_address(host)

    def crash(self, host: str) -> None:
        """The programs of a host break (SIGKILL), with the network as it is; they are started again."""
        for service in self._hosts[host].services():
            self._to_end.add(service)
            os.kill(self._running.pid(service), signal.SIGKILL)

    def shut_down(self) -> dict[str, int]:
        """End everything as systemd does, routers last; the exit status of each.

        zenohd leaves SIGTERM to the kernel: for systemd that is a clean end too.
        """
        order = sorted(self._running.names(), key=lambda name: "-router-" in name)
        statuses = {name: self._running.end(name) for name in order}
        clean = {name for name, status in statuses.items() if _is_zenohd(name) and status == -signal.SIGTERM}
        return statuses | dict.fromkeys(clean, 0)

    def wait_until(self, condition: Callable[[], T | None], what: str, every_s: float = 0.2) -> T:
        """Wait for ``condition``, and start again what has been broken, as systemd would; nothing else may end."""

        def kept() -> T | None:
            for name, status in self._running.ended().items():
                assert name in self._to_end or _is_zenohd(name), f"{name}: {status}: {self._running.log(name)}"
                self._to_end.discard(name)
                self._start_service(next(host for host in self._hosts if name in self._hosts[host].services()), name)
            return condition()

        return wait_until(kept, what, every_s=every_s)

    def log(self, service: str) -> str:
        """What a service has said so far."""
        return self._running.log(service)

    def logged(self) -> list[tuple[str, int]]:
        """Log and sequence of every sweep that the gateway has."""
        file = self._hosts["attic-pi"].root / "var/lib/noctule/gateway.attic/u1.sqlite"
        log_id = "(SELECT log_id FROM log)"
        return _rows(file, f"SELECT {log_id}, log_sequence FROM sweeps ORDER BY log_sequence")

    def stored(self) -> list[tuple[str, int]]:
        """The same of every sweep that the mapper has."""
        file = self._hosts["server"].root / f"var/lib/noctule/mapper.cartographer/{SITE}.sqlite3"
        return _rows(file, "SELECT log_id, log_sequence FROM sweep ORDER BY log_sequence")

    def sequences(self) -> list[int]:
        """The unit's own count of the sweeps that the mapper has, in their order."""
        file = self._hosts["server"].root / f"var/lib/noctule/mapper.cartographer/{SITE}.sqlite3"
        with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
            rows = database.execute("SELECT record FROM sweep ORDER BY log_sequence").fetchall()
        return [Sweep.FromString(record).sequence for (record,) in rows]

    def typed(self, *command: str) -> subprocess.CompletedProcess[str]:
        """What a command prints that the operator types at the desk."""
        environment = os.environ | {"NOCTULE_TLS": str(self._folder / "rendered/operator.anna.g1"), "COLUMNS": "200"}
        return subprocess.run(
            self.network.within(DESK, *command),
            capture_output=True,
            text=True,
            env=environment,
            timeout=PATIENCE_S,
            check=False,
        )

    def contour(self) -> Contour | None:
        """The map, as a program of the operator reads it at the desk; None while there is none."""
        read = self.typed(sys.executable, "-c", READ_CONTOUR, SITE)
        assert read.returncode == 0, read.stderr
        return Contour.FromString(bytes.fromhex(read.stdout)) if read.stdout else None

    def states(self) -> dict[str, str]:
        """The state of each program, as ``noctule-deploy status`` shows it at the desk."""
        lines = self.typed("noctule-deploy", "status", *self._fleet()).stdout.splitlines()
        rows = [[cell.strip() for cell in line.split("│")[1:-1]] for line in lines if line.startswith("│")]
        return {row[1]: row[3] for row in rows}

    def _fleet(self) -> list[str]:
        return [str(self._folder / "fleet.toml"), "--out", str(self._folder / "rendered")]

    def _start_service(self, host: str, service: str) -> None:
        command = self._hosts[host].command(service)
        self._start(
            host,
            service,
            _router(command) if "-router-" in service else command,
            self._hosts[host].environment(service),
        )

    def _start(self, host: str, name: str, command: list[str], environment: dict[str, str]) -> None:
        self._running.start(name, *self.network.within(host, *command), env=environment)


@contextlib.contextmanager
def several_hosts(folder: Path) -> Iterator[SeveralHosts]:
    """The fleet, rendered and installed; all hosts are off, and no cable is in."""
    with network() as made, programs(folder) as running:
        yield SeveralHosts(folder, made, running)


def _is_zenohd(service: str) -> bool:
    """Whether it is a program that may end by itself: zenohd does where a host does not have its address yet."""
    return "-router-" in service and ZENOHD is not None


def _router(command: list[str]) -> list[str]:
    """zenohd where there is one, else the gateway's own router from the same folder."""
    if ZENOHD:
        return [ZENOHD, *command[1:]]
    return ["noctule-gateway", "router", "--tls", str(Path(command[-1]).parent)]


def _rows(file: Path, statement: str) -> list[tuple[str, int]]:
    if not file.exists():
        return []
    with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as database:
        try:
            return database.execute(statement).fetchall()
        except sqlite3.OperationalError as error:
            if "no such table" in str(error):  # it is being made
                return []
            raise
