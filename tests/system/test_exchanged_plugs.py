"""Two units of real firmware whose plugs are exchanged while both gateways' lines stay open, in lockstep.

Both units run under the same boot number and count their sweeps from 0, so nothing but the serial number tells their
sweeps apart.
"""

from contextlib import ExitStack
from pathlib import Path
from random import Random

import pytest
from firmware.images import of_protocol_2, of_unit
from firmware.stepped_unit import IMAGE, SteppedUnit, stepped_unit

from noctule_gateway.link.events import Event, Refused, StatusRead, SweepRead
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.link.voucher import VOUCHES_FOR_S
from noctule_gateway.wire import frames
from noctule_gateway.wire.codec import FrameReader
from noctule_gateway.wire.frames import AnySweep, Status

STEP_S = 0.02
COMMIT_S = 0.3  # a slow disk: plugs may be exchanged between a sweep and its acknowledgement
QUICK = frames.Configure(0, -8192, 4096, 5, 30, 800, 50, 0, 1)  # sweeps of half a second
SWEEPING = Wanted(QUICK, frames.Start(0, 0), running=True)


class Plug:
    """A unit, and the sweeps that it has sent."""

    def __init__(self, unit: SteppedUnit) -> None:
        self.unit = unit
        self.made: set[AnySweep] = set()
        self._reader = FrameReader()

    def exchange_bytes(self, data: bytes) -> bytes:
        """Hand ``data`` to the unit and let it run for a step; what it has sent."""
        sent = self.unit.step(feed=[data.hex()], until_s=self.unit.now_s + STEP_S)
        self.made.update(frame for frame in self._reader.feed(sent) if isinstance(frame, AnySweep))
        return sent


class Socket:
    """A gateway's line that stays open, its link, and what that has committed."""

    def __init__(self, serial: int, now_s: float) -> None:
        self.link = Link(serial, SWEEPING, first_request=1)
        self.committed: list[AnySweep] = []
        self.refused = 0
        self.status: Status | None = None
        self._committing: list[tuple[float, AnySweep]] = []
        self.link.connected(now_s)

    def exchange_bytes(self, plug: Plug | None, now_s: float) -> None:
        """One step with the unit that is plugged in, if one is."""
        self._commit(now_s)
        self._take(self.link.advance(now_s), now_s)
        said = self.link.output(now_s)
        if plug is not None:
            self._take(self.link.receive(plug.exchange_bytes(said), now_s + STEP_S), now_s + STEP_S)

    def _take(self, events: list[Event], now_s: float) -> None:
        for event in events:
            match event:
                case SweepRead(sweep):
                    self._committing.append((now_s + COMMIT_S, sweep))
                case StatusRead(status):
                    self.status = status
                case Refused():
                    self.refused += 1

    def _commit(self, now_s: float) -> None:
        while self._committing and self._committing[0][0] <= now_s:
            sweep = self._committing.pop(0)[1]
            self.committed.append(sweep)
            self.link.committed(sweep, now_s)


class Bench:
    """Two sockets and two plugs; times are simulated ones."""

    def __init__(self, units: list[SteppedUnit]) -> None:
        self.plugs = [Plug(unit) for unit in units]
        self.sockets = [Socket(serial, 0.0) for serial in (1, 2)]
        self._in_socket: list[Plug | None] = [*self.plugs]
        self._now_s = 0.0

    def run(self, duration_s: float) -> None:
        """Let time pass."""
        end_s = self._now_s + duration_s
        while self._now_s < end_s:
            for socket, plug in zip(self.sockets, self._in_socket, strict=True):
                socket.exchange_bytes(plug, self._now_s)
            for plug in self.plugs:
                if plug not in self._in_socket:
                    plug.exchange_bytes(b"")
            self._now_s += STEP_S

    def exchange(self, hand_s: float) -> None:
        """Pull both plugs and put each into the other's socket, which takes a hand so long. An order is pending then.

        It sets the waypoint to the number of the unit that it is for.
        """
        for serial, socket in enumerate(self.sockets, start=1):
            if socket.link.identified:
                socket.link.order(frames.SetWaypoint(0, serial))
        exchanged = self._in_socket[::-1]
        self._in_socket = [None, None]
        self.run(hand_s)
        self._in_socket = exchanged

    def drain(self) -> None:
        """Have both units stop, and let them deliver what they hold."""
        self.run(12.0)  # a refused link greets again after 5 s, an identified one after 10 s
        for socket in self.sockets:
            socket.link.order(frames.Stop(0))
        self.run(10.0)


@pytest.fixture(scope="module")
def image_of(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """By protocol."""
    return {2: of_protocol_2(tmp_path_factory.mktemp("protocol-2")), 3: IMAGE}


@pytest.mark.parametrize(
    ("protocols", "hand_s"),
    [((3, 3), 0.0), ((2, 2), VOUCHES_FOR_S), ((3, 2), VOUCHES_FOR_S)],
    ids=["3 and 3", "2 and 2", "3 and 2"],
)
def test_exchanged_plugs_cost_no_sweep_its_unit_and_no_unit_a_sweep(
    tmp_path: Path, image_of: dict[int, Path], protocols: tuple[int, int], hand_s: float
) -> None:
    random = Random(1)
    with ExitStack() as stack:
        units = []
        for serial, protocol in enumerate(protocols, start=1):
            image = of_unit(serial, tmp_path / f"{serial}.hex", image_of[protocol])
            units.append(stack.enter_context(stepped_unit("--laps", "0", "--seed", str(serial), image=image)))
        bench = Bench(units)
        bench.run(15.0)  # half way between two HELLO
        for _ in range(6):
            bench.exchange(hand_s)
            bench.run(random.uniform(0.1, 8.0))
        bench.drain()
    for serial, (socket, plug) in enumerate(zip(bench.sockets, bench.plugs, strict=True), start=1):
        assert {sweep.waypoint for sweep in plug.made} <= {frames.NO_WAYPOINT, serial}
        assert socket.refused > 0
        assert socket.status is not None and socket.status.sweeps_waiting == 0
        assert len(socket.committed) == socket.status.sweeps_made > 20
        assert set(socket.committed) == plug.made
