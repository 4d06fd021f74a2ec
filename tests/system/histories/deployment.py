"""A site as it is deployed: units, gateway, router, mapper and relay, each a real process, and its faults."""

import contextlib
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import psutil
from system.histories import host
from system.histories.cable import Cable, Condition, Witness
from system.histories.checker import LogExtent, held_sweeps, log_extent
from system.histories.faults import UNITS, Fault
from system.histories.forked import Nursery
from system.processes import ROOT, Programs, programs

from noctule.messages_pb2 import Sweep

SITE = "storm"
_ROUTER = "tcp/127.0.0.1:7447"
_RELAY_PORT, _WEB_PORT = 9876, 9090
_UNIT_PORT, _LINE_PORT = 7001, 7101  # the deployment has a host of its own, and so all its ports
_IDENTITY = "1badcafe"
_DISKS, _DISK_MB = ("gateway", "mapper"), 64
_FORKED = ("gateway", "mapper")
_RESTART_S = 1.0  # systemd waits 0.1 s by default, and gives up after five starts in 10 s
_STOPPED_BY = ("killed", "replaced", "without power")
_CONDITIONS = {"noisy": Condition.NOISY, "hung": Condition.HUNG, "pulled": Condition.PULLED}

_UNIT = """
[[unit]]
name = "{name}"
serial = {serial}
address = "socket://127.0.0.1:{port}"
pose = {{ x_m = {x_m}, y_m = -0.45, heading_deg = 0.0 }}
sweep = {{ start = true, count = {count}, bearing_step_deg = 10.0, pause_s = {pause_s} }}
"""
_SWEEPS = ((1, 0.2), (3, 0.0), (5, 0.0))  # readings and pause: of each 3, 1 and 0.5 a second
# Every sweep stays in the store. The contour is fitted seldom: what the mapper holds is tried here, not its map.
_MAPPER = """
[window]
max_age_s = 1e9
max_sweeps = 20000
sweeps_per_place = 1000000
[pace]
shortest_interval_s = 60.0
most_time_share = 0.05
"""


class Deployment:
    """All programs of the site run, but for those that a fault keeps down.

    Gateway and mapper come from ``nursery``.
    """

    def __init__(
        self, folder: Path, running: Programs, cable: Cable, nursery: Nursery, seed: int, keep_s: float
    ) -> None:
        self._folder, self._running, self._cable = folder, running, cable
        self._clock, self._nursery = nursery.clock, nursery
        self._commands = _commands(folder, seed, keep_s)
        self._identity = [_IDENTITY]
        self._down: set[str] = set()
        self._frozen: set[str] = set()
        self._full: set[str] = set()
        self._started_s: dict[str, float] = {}
        self.ended: list[str] = []  # programs that ended by themselves, and were started again
        for name in self._commands:
            self._start(name)

    def bring_about(self, faults: Sequence[Fault]) -> None:
        """Have just these faults, from now on."""
        now = {(fault.target, fault.kind) for fault in faults}
        self._clock.set(sum(fault.hours for fault in faults))
        self._cable.bring_into(
            {
                UNITS.index(fault.target): _CONDITIONS[fault.kind]
                for kind in _CONDITIONS  # the worst last
                for fault in faults
                if fault.target in UNITS and fault.kind == kind
            }
        )
        for name in _DISKS:
            self._fill(name, (name, "disk full") in now)
        if ("router", "replaced") in now:
            self._identity = []
        for name in self._commands:
            self._bring_into(
                name, down=any((name, kind) in now for kind in _STOPPED_BY), frozen=(name, "frozen") in now
            )

    def look_after(self) -> None:
        """Start what has ended by itself, as systemd would."""
        for name, status in self._running.ended().items():
            self.ended.append(f"{name} ended by itself with status {status}: {self._last_words(name)}")
        for name in self._commands:
            away = name not in self._down and not self._running.runs(name)
            if away and time.monotonic() - self._started_s[name] >= _RESTART_S:
                self._start(name)

    def witnesses(self) -> dict[str, Witness]:
        """What has passed at each unit's end of its line."""
        return dict(zip(UNITS, self._cable.witnesses(), strict=True))

    def held(self) -> dict[str, list[Sweep]]:
        """The sweeps in the mapper's store, by unit. Raises sqlite3.Error."""
        return held_sweeps(self._folder / "mapper" / f"{SITE}.sqlite3")

    def extent(self, unit: str) -> LogExtent:
        """How far the unit's log goes. Raises sqlite3.Error."""
        return log_extent(self._folder / "gateway" / f"{unit}.sqlite")

    def _bring_into(self, name: str, down: bool, frozen: bool) -> None:
        if down and name not in self._down:
            self._down.add(name)
            self._frozen.discard(name)
            if self._running.runs(name):
                self._running.kill(name)
        if not down and name in self._down:
            self._down.discard(name)
            self._start(name)
        if self._running.runs(name) and frozen != (name in self._frozen):
            self._signal(name, psutil.Process.suspend if frozen else psutil.Process.resume)
            self._frozen ^= {name}

    def _start(self, name: str) -> None:
        command = [*self._commands[name], *(self._identity if name == "router" else ())]
        if name in _FORKED:
            self._running.take(name, partial(self._nursery.start, command))
        else:
            self._running.start(name, *command, env=self._clock.environment if name == "router" else None)
        self._started_s[name] = time.monotonic()

    def _signal(self, name: str, send: Callable[[psutil.Process], None]) -> None:
        process = psutil.Process(self._running.pid(name))
        for each in [process, *process.children(recursive=True)]:
            with contextlib.suppress(psutil.NoSuchProcess):
                send(each)

    def _fill(self, name: str, full: bool) -> None:
        if full != (name in self._full):
            (host.fill if full else host.empty)(self._folder / name)
            self._full ^= {name}

    def _last_words(self, name: str) -> str:
        return " | ".join(self._running.log(name).splitlines()[-3:])


@contextlib.contextmanager
def deployment(folder: Path, nursery: Nursery, seed: int, keep_s: float) -> Iterator[Deployment]:
    """A site in ``folder`` whose logs keep ``keep_s`` of sweeps; on a host of its own, see ``host``."""
    for name in _DISKS:
        host.mount(folder / name, _DISK_MB)
    (folder / "site.toml").write_text(_site_file())
    (folder / "mapper.toml").write_text(_MAPPER)
    ports = range(len(UNITS))
    with programs(folder) as running:
        cable = Cable([_UNIT_PORT + n for n in ports], [_LINE_PORT + n for n in ports], seed)
        with contextlib.closing(cable):
            yield Deployment(folder, running, cable, nursery, seed, keep_s)
    for name in _DISKS:
        host.unmount(folder / name)


def _site_file() -> str:
    """Units that stand 10 cm apart and sweep without end."""
    text = f'site = "{SITE}"\n'
    for number, (name, (count, pause_s)) in enumerate(zip(UNITS, _SWEEPS, strict=True)):
        place = {"x_m": 0.1 * number - 0.7, "port": _LINE_PORT + number}
        text += _UNIT.format(name=name, serial=number + 1, count=count, pause_s=pause_s, **place)
    return text


def _commands(folder: Path, seed: int, keep_s: float) -> dict[str, list[str]]:
    """What a user would type."""
    firmware = ROOT / "firmware/build/noctule.ihx"
    return {
        "units": f"noctule-sim --firmware {firmware} --room paper --units {len(UNITS)} --seed {seed} "
        f"--tcp 127.0.0.1:{_UNIT_PORT} --state {folder}/units".split(),
        "router": ["python", str(Path(__file__).with_name("router.py")), _ROUTER],
        "gateway": f"noctule-gateway run {folder}/site.toml --data {folder}/gateway --connect {_ROUTER} "
        f"--keep-days {keep_s / 86400.0}".split(),
        "relay": f"noctule-viewer run --port {_RELAY_PORT} --web-port {_WEB_PORT} --memory-limit 64MB".split(),
        "mapper": f"noctule-mapper run --site {SITE} --data {folder}/mapper --connect {_ROUTER} "
        f"--config {folder}/mapper.toml --rerun rerun+http://127.0.0.1:{_RELAY_PORT}/proxy".split(),
    }
