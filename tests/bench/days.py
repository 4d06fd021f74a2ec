"""Whether memory grows over ten simulated days, from the time when windows, caches and the relay are full.

    PYTHONPATH=tests python tests/bench/days.py
    PYTHONPATH=tests python tests/bench/days.py --firmware

The first streams the sweeps of two units that stand still, one each 16 s of their time, through a gateway's log and
publishing as fast as the mapper takes them. The second runs the real firmware and gateway, which is some fifty times
as fast as real time; there a day takes half an hour.
"""

import argparse
import contextlib
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import psutil
from bench.scale.gateway import StreamedUnit, open_units
from system.processes import ROOT, Programs, free_port_range, free_ports, listens, programs, wait_until

from noctule.client import Client
from noctule.messages_pb2 import ServiceStatus, Sweep

DAY_S = 86_400.0
CADENCE_S = 16.0  # a fixed unit's 61 bearings and its pause: deploy/demo/sites/lounge.toml
LOOK_EVERY_S = 5.0
UNITS = 2
RELAY = ("--memory-limit", "8MB")  # it keeps drawings, and so grows, until it is full: with so little in four days
REPORT_EVERY_S = 1.0
MOST_AHEAD = 500  # sweeps that the mapper has not reported yet; it reports each second


@dataclass(frozen=True)
class Look:
    """Memory in MB (RSS of a program and its children) at a time: simulated days, and sweeps so far."""

    days: float
    sweeps: int
    memory_mb: dict[str, float]


@dataclass(frozen=True)
class Scene:
    """What runs: the processes to look at, and simulated days and sweeps so far; step() goes on for a while."""

    pids: dict[str, int]
    progress: Callable[[], tuple[float, int]]
    step: Callable[[], None]


def looks(scene: Scene, minutes: float, days: float) -> list[Look]:
    """Run for ``minutes`` or until ``days`` have passed, and look at the memory now and then."""
    found, until_s = [], time.monotonic() + 60 * minutes
    while time.monotonic() < until_s and scene.progress()[0] < days:
        next_s = time.monotonic() + LOOK_EVERY_S
        while time.monotonic() < next_s:
            scene.step()
        found.append(Look(*scene.progress(), {name: _memory_mb(pid) for name, pid in scene.pids.items()}))
    return found


@contextlib.contextmanager
def streamed(folder: Path, days: float) -> Iterator[Scene]:
    """This process is the gateway."""
    (bus_port,) = free_ports(1)
    endpoint = f"tcp/127.0.0.1:{bus_port}"
    with programs(folder) as running, contextlib.ExitStack() as closing:
        environment = os.environ | {"PYTHONPATH": str(ROOT / "tests")}
        running.start("router", sys.executable, "-m", "bench.scale.router", endpoint, env=environment)
        wait_until(lambda: listens(bus_port), "no router", within_s=60)
        relay = _start_relay(running)
        units = open_units(folder, "site-0", UNITS, endpoint, closing)
        _start_mapper(running, folder, "site-0", endpoint, relay)
        stream = _Stream(units, time.time_ns() - int((days + 1) * DAY_S * 1e9))
        client = closing.enter_context(Client("site-0", connect=[endpoint]))
        client.on_service_status(stream.note)
        pids = {"gateway": os.getpid()} | {name: running.pid(name) for name in ("router", "mapper", "relay")}
        yield Scene(pids, stream.progress, stream.step)


class _Stream:
    """Sweeps of all units by turns, no farther ahead of the mapper than it can be seen to follow."""

    def __init__(self, units: Sequence[StreamedUnit], began_ns: int) -> None:
        self._units, self._began_ns = units, began_ns
        self._taken: dict[str, int] = {}
        self._has_taken = threading.Condition()
        self._reported_s = 0.0

    def note(self, status: ServiceStatus) -> None:
        """How far the mapper says that it is."""
        with self._has_taken:
            self._taken.update({cursor.unit: cursor.log_sequence for cursor in status.cursors})
            self._has_taken.notify()

    def step(self) -> None:
        """A few sweeps, if the mapper follows; and the statuses of each second."""
        if time.monotonic() >= self._reported_s + REPORT_EVERY_S:
            self._reported_s = time.monotonic()
            for unit in self._units:
                unit.report()
        with self._has_taken:
            follows = self._has_taken.wait_for(lambda: self._ahead() <= MOST_AHEAD, timeout=REPORT_EVERY_S)
        if follows:
            for unit in self._units:
                unit.sweep(self._began_ns + round(unit.made * CADENCE_S * 1e9))

    def _ahead(self) -> int:
        return sum(unit.made for unit in self._units) - sum(self._taken.values())

    def progress(self) -> tuple[float, int]:
        """Simulated days, and sweeps that the mapper has taken."""
        return min(self._taken.values(), default=0) * CADENCE_S / DAY_S, sum(self._taken.values())


@contextlib.contextmanager
def firmware(folder: Path, _days: float) -> Iterator[Scene]:
    """The demo's lounge at the simulator's own pace."""
    unit_port, (bus_port,) = free_port_range(UNITS), free_ports(1)
    endpoint, site = f"tcp/127.0.0.1:{bus_port}", folder / "site.toml"
    text = (ROOT / "deploy/demo/sites/lounge.toml").read_text()
    for number in range(UNITS):
        text = text.replace(f"127.0.0.1:{7101 + number}", f"127.0.0.1:{unit_port + number}")
    site.write_text(text)
    starts: list[float] = []

    def note(sweep: Sweep) -> None:
        starts.append(sweep.start.ToNanoseconds() * 1e-9)

    with programs(folder) as running:
        relay = _start_relay(running)
        data = str(folder / "gateway")
        running.start("gateway", "noctule-gateway", "run", str(site), "--data", data, "--listen", endpoint)
        _start_mapper(running, folder, "lounge", endpoint, relay)
        simulator = f"noctule-sim --room lounge --units {UNITS} --speed max --exact-clocks --tcp 127.0.0.1:{unit_port}"
        running.start("simulator", *simulator.split())
        with Client("lounge", connect=[endpoint]) as client:
            client.on_sweep(note)
            pids = {name: running.pid(name) for name in ("simulator", "gateway", "mapper", "relay")}
            passed = lambda: ((max(starts) - starts[0]) / DAY_S if starts else 0.0, len(starts))  # noqa: E731
            yield Scene(pids, passed, lambda: time.sleep(LOOK_EVERY_S))


def _start_relay(running: Programs) -> str:
    port, web_port = free_ports(2)
    running.start("relay", "noctule-viewer", "run", "--port", str(port), "--web-port", str(web_port), *RELAY)
    wait_until(lambda: listens(port), "no relay", within_s=90)
    return f"rerun+http://127.0.0.1:{port}/proxy"


def _start_mapper(running: Programs, folder: Path, site: str, endpoint: str, relay: str) -> None:
    where = ("--site", site, "--data", str(folder / "mapper"), "--connect", endpoint, "--rerun", relay)
    running.start("mapper", "noctule-mapper", "run", *where)


def _memory_mb(pid: int) -> float:
    process = psutil.Process(pid)
    return sum(each.memory_info().rss for each in (process, *_programs_below(process))) / 1e6


def _programs_below(process: psutil.Process) -> list[psutil.Process]:
    """This bench's own children are looked at by themselves."""
    return [] if process.pid == os.getpid() else process.children(recursive=True)


def table(found: Sequence[Look], first_day: float) -> list[str]:
    """Memory at the first look after ``first_day``, then at some of the others, and the growth from first to last."""
    later = [look for look in found if look.days >= first_day] or list(found[-1:])
    first, last = later[0], later[-1]
    lines = [f"{'':12}" + "".join(f"{name:>12}" for name in first.memory_mb)]
    for look in [*later[: -1 : max(1, len(later) // 8)], last]:
        cells = "".join(f"{memory_mb:9.1f} MB" for memory_mb in look.memory_mb.values())
        lines.append(f"{look.days:7.2f} days{cells}   {look.sweeps} sweeps")
    grown = "".join(f"{100 * (last.memory_mb[name] / first.memory_mb[name] - 1):+10.1f} %" for name in first.memory_mb)
    return [*lines, f"{'growth':12}{grown}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0, help="after which it ends")
    parser.add_argument("--days", type=float, default=14.0, help="simulated days after which it ends sooner")
    parser.add_argument("--first-day", type=float, default=4.0, help="simulated days from which growth counts")
    parser.add_argument("--firmware", action="store_true", help="the real firmware and gateway")
    given = parser.parse_args()
    scene = firmware if given.firmware else streamed
    with tempfile.TemporaryDirectory() as folder, scene(Path(folder), given.days) as running:
        found = looks(running, given.minutes, given.days)
    for line in table(found, given.first_day):
        print(line, flush=True)


if __name__ == "__main__":
    main()
