"""Units that share a room: each with its real firmware, link, clock and turns, all on one simulated time."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from firmware.stepped_unit import IMAGE
from system.processes import PATIENCE_S

from noctule.site import Site
from noctule_gateway.clock.boot_clocks import BootClocks
from noctule_gateway.link.events import ClockRead, Event, Identified, StatusRead, SweepRead
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.turns.keeper import TurnKeeper
from noctule_gateway.turns.timetable import Crowd, Turn
from noctule_gateway.unit.plans import wanted_plan
from noctule_gateway.wire import orders
from noctule_gateway.wire.frames import AnySweep, Start, Status

UTC_OFFSET_S = 1.8e9  # of simulated time
_ANSWERED_WITHIN_S = 0.008  # mostly
_LOOK_EVERY_S = 0.001  # while an answer is awaited: a clock is known as well as the answer's time
# What has come is handed on a look later, as an adapter does that is asked each millisecond.
_INSTANT_S = 1e-6


class Server:
    """What a gateway has for one unit, as unit_server.py joins it, on simulated time."""

    def __init__(self, site: Site, index: int, turn: Turn | Crowd | None) -> None:
        unit = site.units[index]
        self.clocks = BootClocks(nominal=False, anchor=lambda _: None)
        self.keeper = TurnKeeper(turn)
        wanted = Wanted(wanted_plan(unit), orders.start(unit.pause_s), unit.start)
        self.link = Link(unit.serial, wanted, 40, self._in_turn)
        self.sweeps: list[AnySweep] = []
        self.status: Status | None = None
        self.starts: list[tuple[float, Start]] = []
        self._look_s = 0.0
        self.take(self.link.connected(0.0), 0.0)

    def output(self, now_s: float) -> bytes:
        """As UnitServer.advance() and output()."""
        self.take(self.link.advance(now_s), now_s)
        if now_s >= self._look_s:
            self._look_s = now_s + 1.0
            if self.keeper.look(self.clocks.line(UTC_OFFSET_S), now_s):
                self.link.start_again()
        return self.link.output(now_s)

    def take(self, events: list[Event], now_s: float) -> None:
        for event in events:
            match event:
                case Identified(hello, _):
                    self.clocks.begin(hello.boot_of_life, now_s, UTC_OFFSET_S)
                    self.keeper.met(hello, now_s)
                case ClockRead(exchange):
                    self.clocks.add(exchange)
                case StatusRead(status):
                    self.status = status
                    self.keeper.said(status)
                case SweepRead(sweep):
                    self.sweeps.append(sweep)
                    self.link.committed(sweep, now_s)
                case _:
                    pass

    @property
    def in_turn(self) -> bool:
        return self.status is not None and self.status.in_turn

    def _in_turn(self, start: Start, now_s: float) -> Start:
        told = self.keeper.start(start, self.clocks.line(UTC_OFFSET_S), now_s)
        self.starts.append((now_s, told))
        return told


class TurnsRoom:
    """The units of a simulated room and their servers."""

    def __init__(self, process: subprocess.Popen[str], servers: list[Server]) -> None:
        self._process, self.servers = process, servers
        self.now_s = self._asked_s = 0.0
        self._came = self._held = [b""] * len(servers)
        self.truth: list[dict[str, Any]] = []

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self.now_s + duration_s
        while self.now_s < end_s - _INSTANT_S:
            self._step(end_s)

    def inject(self, kind: str, **details: Any) -> None:
        """Inject a fault of the simulator's README, now."""
        self._ask(fault={"kind": kind, **details})

    @property
    def echoes_of_others(self) -> int:
        """Pings so far that ended with another unit's sound."""
        return sum(truth["echoes_of_others"] for truth in self.truth)

    def _step(self, end_s: float) -> None:
        for server, came in zip(self.servers, self._held, strict=True):
            if came:
                server.take(server.link.receive(came, self.now_s), self.now_s)
        self._held = self._came
        feed = [server.output(self.now_s) for server in self.servers]
        if any(feed):
            self._asked_s = self.now_s
        due_s = min(server.link.next_s for server in self.servers)
        look_s = self.now_s + _LOOK_EVERY_S
        awaits = any(self._held) or self.now_s < self._asked_s + _ANSWERED_WITHIN_S
        until_s = min(end_s, look_s if awaits else max(due_s, look_s))
        self._ask(feed=[data.hex() for data in feed], until_s=until_s, stop_at_frame=True)

    def _ask(self, **request: Any) -> None:
        """One request of ``noctule-sim --control``; what the units have sent is kept."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline())
        self.now_s, self.truth = answer["now_s"], answer["truth"]
        self._came = [bytes.fromhex(sent) for sent in answer["sent"]]


@contextmanager
def turns_room(room: Path, site: Site, turns: dict[str, Turn | Crowd], seed: int = 1) -> Iterator[TurnsRoom]:
    """The units of ``room``, which are those of ``site`` in its order, at power-up."""
    command = ["noctule-sim", "--control", "--firmware", str(IMAGE), "--room", str(room), "--seed", str(seed)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        servers = [Server(site, index, turns.get(unit.name)) for index, unit in enumerate(site.units)]
        yield TurnsRoom(process, servers)
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
