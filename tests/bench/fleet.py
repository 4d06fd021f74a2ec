"""What a fleet of simulated units costs one core at real time, with another core taking their sweeps over TCP."""

import os
import re
import resource
import selectors
import socket
import subprocess
from dataclasses import dataclass

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import Ack, Hello, Start, Sweep

COMMAND = ("noctule-sim", "--firmware", "firmware/build/noctule.ihx", "--speed", "1", "--tcp", "127.0.0.1:0")
SIMULATORS_CORE = {0}


@dataclass(frozen=True)
class Load:
    """What was seen of a fleet over a run."""

    pace: float  # simulated seconds per second: 1 if the core kept up
    core_share: float  # seconds of processor time per simulated second
    sweeps: int  # acknowledged, each once
    missed: int  # sequence numbers that were skipped


class _Gateway:
    """The far end of one unit's line: has it sweep without end and acknowledges each sweep."""

    def __init__(self, address: tuple[str, int]) -> None:
        self.connection = socket.create_connection(address)
        self.sequences: list[int] = []
        self._reader = FrameReader()
        self._start()

    def _start(self) -> None:
        self.connection.sendall(encode(Start(request=1, pause_ms=0)))

    def hear(self) -> bool:
        """Take what has come; False once the simulator has ended."""
        data = self.connection.recv(65536)
        for frame in self._reader.feed(data):
            match frame:
                case Hello(request=0):
                    self._start()
                case Sweep(boot=boot, sequence=sequence, serial=serial, life=life):
                    self.connection.sendall(encode(Ack(boot, sequence, serial, life)))
                    if sequence not in self.sequences[-1:]:
                        self.sequences.append(sequence)
        return bool(data)


def load(units: int, duration_s: float) -> Load:
    """Run ``units`` units at real time for ``duration_s`` on the first core, the far ends on the others."""
    cores = os.sched_getaffinity(0)
    used_before_s = _children_s()
    command = [*COMMAND, "--units", str(units), "--duration", str(duration_s)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as simulator:
        try:
            os.sched_setaffinity(simulator.pid, SIMULATORS_CORE)
            os.sched_setaffinity(0, cores - SIMULATORS_CORE or cores)
            assert simulator.stdout is not None
            gateways = [_Gateway(_address(simulator.stdout.readline())) for _ in range(units)]
            _serve(gateways)
            pace = re.search(r"([\d.]+) times real time", simulator.stdout.read())
        finally:
            os.sched_setaffinity(0, cores)
            simulator.terminate()
    if pace is None:
        raise SystemExit("the simulator did not come to its end")
    sweeps = sum(len(gateway.sequences) for gateway in gateways)
    missed = sum(g.sequences[-1] - g.sequences[0] + 1 - len(g.sequences) for g in gateways if g.sequences)
    return Load(float(pace[1]), (_children_s() - used_before_s) / duration_s, sweeps, missed)


def _serve(gateways: list[_Gateway]) -> None:
    """Until the simulator has hung up on every line."""
    with selectors.DefaultSelector() as selector:
        for gateway in gateways:
            selector.register(gateway.connection, selectors.EVENT_READ, gateway)
        while selector.get_map():
            for key, _ in selector.select():
                if not key.data.hear():
                    selector.unregister(key.fileobj)
                    key.data.connection.close()


def _address(announcement: str) -> tuple[str, int]:
    found = re.search(r"socket://([\d.]+):(\d+)", announcement)
    if found is None:
        raise SystemExit(f"the simulator said: {announcement!r}")
    return found[1], int(found[2])


def _children_s() -> float:
    """Processor time of the children that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def table() -> list[str]:
    """A fleet of the size that one core is to hold."""
    seen = load(units=300, duration_s=60.0)
    return [
        f"{seen.pace:12.2f} simulated seconds a second",
        f"{seen.core_share:12.2f} of the core's time for each of them",
        f"{seen.sweeps:12} sweeps acknowledged, {seen.missed} missed",
    ]
