"""The programs of a large fleet on this machine, measured while they run."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
import zenoh
from bench.scale import times
from bench.scale.times import Times
from system.processes import Programs, free_ports, listens, programs, wait_until

from noctule import bus
from noctule_mapper.sharing.rendezvous import owner_of
from noctule_mapper.sharing.service import other_mappers

_TESTS = Path(__file__).parents[2]


@dataclass(frozen=True)
class Size:
    """How much there is of everything; a unit sweeps each ``sweep_s``."""

    units: int
    sites: int
    routers: int
    mappers: int
    sweep_s: float


@dataclass(frozen=True)
class Cost:
    """Of all processes of one kind: processor seconds so far, and memory that is theirs (PSS)."""

    processor_s: float
    memory_mb: float


class Fleet:
    """A fleet that runs."""

    def __init__(self, size: Size, folder: Path, running: Programs, gateways: subprocess.Popen[str]) -> None:
        self.size, self._folder, self.running, self._gateways = size, folder, running, gateways
        self.sites = [f"site-{number}" for number in range(size.sites)]
        self.names = [f"m{number}" for number in range(1, size.mappers + 1)]

    def costs(self) -> dict[str, Cost]:
        """What each kind of program has cost so far."""
        kinds = {"router": _pids(self.running, "router"), "gateway": [self._gateways.pid], "mapper": []}
        kinds["mapper"] = _pids(self.running, "m")
        return {kind: _cost(pids) for kind, pids in kinds.items()}

    def processor_s(self, but: str) -> float:
        """What all programs ``but`` one have taken so far."""
        pids = [self._gateways.pid, *(self.running.pid(name) for name in self.running.names() if name != but)]
        return sum(_processor_s(each) for pid in pids for each in _with_children(pid))

    def wait_for_owners(self, session: zenoh.Session, names: Sequence[str], within_s: float) -> float:
        """Seconds until every site is mapped by the mapper that rendezvous hashing gives it."""
        expected, began_s = {site: owner_of(site, names) for site in self.sites}, time.monotonic()

        def mapped() -> bool:
            self.running.check()
            return other_mappers(session, self.sites, but="") == expected

        wait_until(mapped, f"the sites are not mapped by {names}", within_s)
        return time.monotonic() - began_s

    def tell(self, word: str) -> None:
        """Have the gateways do something: see gateways.py."""
        assert self._gateways.stdin is not None
        self._gateways.stdin.write(f"{word}\n")
        self._gateways.stdin.flush()

    def stop_sweeps(self) -> dict[str, int]:
        """No more sweeps; how many each unit has handed over, which is where its log will end."""
        self.tell("stop")
        assert self._gateways.stdout is not None
        return json.loads(self._gateways.stdout.readline())

    def times(self) -> Times:
        """What the mappers have noted so far."""
        return times.read(self._folder / "times")


@contextmanager
def fleet(size: Size, folder: Path) -> Iterator[tuple[Fleet, zenoh.Session]]:
    """Routers, gateways and mappers that share the sites, and a session that looks on."""
    environment = os.environ | {"PYTHONPATH": str(_TESTS), "BENCH_TIMES": str(folder / "times")}
    for name in ("times", "logs"):
        (folder / name).mkdir()
    ports = free_ports(size.routers)
    routers = [f"tcp/127.0.0.1:{port}" for port in ports]
    with programs(folder) as running:
        for number in range(size.routers):
            running.start(
                f"router-{number}",
                sys.executable,
                "-m",
                "bench.scale.router",
                *routers[: number + 1][::-1],
                env=environment,
            )
            wait_until(lambda port=ports[number]: listens(port), "no router", within_s=60)
        command = [str(each) for each in (folder / "logs", size.units, size.sites, size.sweep_s, *routers)]
        with subprocess.Popen(
            [sys.executable, "-m", "bench.scale.gateways", *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        ) as gateways:
            assert gateways.stdout is not None
            assert gateways.stdin is not None
            assert gateways.stdout.readline() == "ready\n"
            made = Fleet(size, folder, running, gateways)
            for number, name in enumerate(made.names):
                _start_mapper(made, name, folder, routers[number % len(routers)], environment)
            session = bus.open_session([routers[0]])
            try:
                yield made, session
            finally:
                session.close()
                for name in made.names:
                    if running.runs(name):
                        running.kill(name)
                gateways.stdin.close()


def _start_mapper(made: Fleet, name: str, folder: Path, router: str, environment: dict[str, str]) -> None:
    shared = [argument for site in made.sites for argument in ("--site", site)]
    where = ("--data", str(folder / name), "--connect", router, "--rerun", "none")
    made.running.start(
        name, sys.executable, "-m", "bench.scale.timed_share", "share", "--name", name, *shared, *where, env=environment
    )


def _pids(running: Programs, prefix: str) -> list[int]:
    return [running.pid(name) for name in running.names() if name.startswith(prefix)]


def _cost(pids: Sequence[int]) -> Cost:
    """Of the processes and all their descendants."""
    processor_s = memory_bytes = 0.0
    for pid in pids:
        for each in _with_children(pid):
            processor_s += _processor_s(each)
            memory_bytes += each.memory_full_info().pss
    return Cost(processor_s, memory_bytes / 1e6)


def _with_children(pid: int) -> list[psutil.Process]:
    process = psutil.Process(pid)
    return [process, *process.children(recursive=True)]


def _processor_s(process: psutil.Process) -> float:
    used = process.cpu_times()
    return used.user + used.system
