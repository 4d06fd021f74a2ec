"""What a sick neighbour costs the healthy: a sweep's way from its unit to a reader's store, beside each sickness.

Model units of one gateway sweep at a steady pace over TCP; a follower of their logs reads them over a router of its own
process. The sick ones: a client that asks for logs without end; the same client frozen while it takes its answers;
a gateway of the same site that is frozen, as by a hung disk; thirty units whose logs take each question and never
answer; a line over which bytes come without end.
"""

import os
import signal
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numpy as np
from gateway.model_unit import ModelUnit
from gateway.tcp_unit import TcpUnit, tcp_unit
from system.processes import Programs, free_ports, programs, wait_until

from noctule import Client, LogFollower
from noctule.messages_pb2 import Sweep

SITE = "bench"
ALONE = "alone"
PERCENTILES = (50, 95, 99)
_IN_MEMORY = "/dev/shm"  # the machine's disk, which others write to, would be most of the latency
HEALTHY = 4
PACE_S = 0.1  # between two sweeps of one unit
LASTS_S = 2.5  # each part of a round
# The healthy site is measured before each sickness, because what else the machine does changes from minute to minute.
ROUNDS = 14
DRAWN = 400  # sets of rounds, for the intervals
UNIT = '[[unit]]\nname = "{name}"\nserial = {serial}\naddress = "{address}"\npose = "key"\n'

FLOOD = f"""
import os, sys
os.nice(19)  # it would have a machine of its own
from noctule import bus, keys
with bus.open_session([sys.argv[1]]) as session:
    print("flooding", flush=True)
    while True:
        replies = [session.get(keys.log("{SITE}", "u1") + "?from=1;max=500", attachment="flood") for _ in range(50)]
        for each in replies:
            list(each)
"""

SILENT = f"""
import sys, threading
from noctule import bus, keys
with bus.open_session([sys.argv[1]]) as session:
    kept = []  # a query that is let go of is at its end
    for n in range(30):
        kept.append(session.declare_queryable(keys.log("{SITE}", f"silent{{n}}"), kept.append))
        kept.append(session.liveliness().declare_token(keys.alive("{SITE}", f"silent{{n}}")))
    print("silent", flush=True)
    threading.Event().wait()
"""


class Line:
    """A line on which nothing comes, or, while ``floods`` is set, bytes without end."""

    def __init__(self) -> None:
        self.floods, self._closed = threading.Event(), threading.Event()
        self._server = socket.create_server(("127.0.0.1", 0))
        self.address = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        """End it."""
        self._closed.set()
        self._server.shutdown(socket.SHUT_RDWR)
        self._thread.join()

    def _run(self) -> None:
        with suppress(OSError):  # shut down
            while True:
                connection, _ = self._server.accept()
                connection.settimeout(1.0)
                with connection, suppress(OSError):
                    while not self._closed.is_set():
                        if self.floods.wait(0.1):
                            connection.sendall(os.urandom(1000))  # some 1 MB/s: a hundred times what a UART brings
                            self._closed.wait(0.001)


class Readers:
    """The sweeps' latencies, from the moment a unit had them to the moment they were delivered."""

    def __init__(self, units: Sequence[TcpUnit]) -> None:
        self._units = units
        self._made_s: dict[tuple[str, int], float] = {}
        self._late_s: list[float] = []

    def deliver(self, sweeps: Sequence[Sweep]) -> None:
        """A follower's callback."""
        now_s = time.perf_counter()
        for sweep in sweeps:
            made_s = self._made_s.pop((sweep.unit, sweep.sequence), None)
            if made_s is not None:
                self._late_s.append(now_s - made_s)

    def latencies_ms(self) -> np.ndarray:
        """Of the sweeps that the units make from now on, for LASTS_S."""
        self._made_s.clear()
        self._late_s.clear()
        pause = threading.Event()
        for _ in range(round(LASTS_S / PACE_S)):
            for number, line in enumerate(self._units):
                with line.lock:
                    made = line.unit.make_sweep(time.monotonic())
                    self._made_s[f"u{number + 1}", made.sequence] = time.perf_counter()
                pause.wait(PACE_S / len(self._units))
        wait_until(lambda: not self._made_s, "sweeps do not come", 60)
        return 1e3 * np.array(self._late_s)


def _site_file(path: Path, units: dict[str, str]) -> str:
    tables = (UNIT.format(name=name, serial=int(name[1:]), address=address) for name, address in units.items())
    path.write_text(f'site = "{SITE}"\n' + "".join(tables))
    return str(path)


@contextmanager
def _site(folder: Path, running: Programs) -> Iterator[tuple[Readers, Line, str]]:
    """Two gateways and a router, all units served and followed; the line that may flood, and the router's endpoint."""
    endpoint = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    with ExitStack() as stack:
        now_s = time.monotonic()
        lines = [stack.enter_context(tcp_unit(ModelUnit(n + 1, born_s=now_s))) for n in range(HEALTHY + 1)]
        sick = Line()
        stack.callback(sick.close)
        healthy = {f"u{n + 1}": line.address for n, line in enumerate(lines[:HEALTHY])}
        good = _site_file(folder / "good.toml", healthy | {"u8": sick.address})
        hung = _site_file(folder / "hung.toml", {f"u{HEALTHY + 1}": lines[HEALTHY].address})
        running.start("router", sys.executable, "-m", "system.histories.router", endpoint, env={"PYTHONPATH": "tests"})
        for name, file in (("good", good), ("hung", hung)):
            data = ("--data", str(folder / name), "--connect", endpoint)
            running.start(name, "noctule-gateway", "run", file, *data, "--name", name)
        client = stack.enter_context(Client(SITE, [endpoint]))
        readers = Readers(lines[:HEALTHY])
        stack.enter_context(LogFollower(client, readers.deliver, {}))
        wait_until(lambda: len(client.units()) == HEALTHY + 2, "not all are served", 60)
        wait_until(lambda: sum(status.boot > 0 for status in client.unit_statuses()) > HEALTHY, "not all answer", 60)
        yield readers, sick, endpoint


def rows() -> list[str]:
    """Median, p95 and p99 beside each sickness, and how many times those of the healthy site, with 95 % intervals."""
    late_ms: dict[str, list[list[np.ndarray]]] = {}  # by sickness and round
    with (
        tempfile.TemporaryDirectory(dir=_IN_MEMORY) as folder,
        programs(Path(folder)) as running,
        _site(Path(folder), running) as (readers, sick, endpoint),
    ):
        readers.latencies_ms()  # so that everything has run once
        for number in range(ROUNDS):
            for what in _parts(running, sick, endpoint, number):
                late_ms.setdefault(what, [[] for _ in range(ROUNDS)])[number].append(readers.latencies_ms())
    by_round = {what: [np.concatenate(each) for each in rounds] for what, rounds in late_ms.items()}
    return [_row(what, rounds, by_round[ALONE]) for what, rounds in by_round.items()]


def _parts(running: Programs, sick: Line, endpoint: str, number: int) -> Iterator[str]:
    """What is wrong in round ``number``: each holds until the next one is asked for."""
    name, silent = f"flood-{number}", f"silent-{number}"
    yield ALONE
    sick.floods.set()
    yield "a line that floods"
    sick.floods.clear()
    yield ALONE
    os.kill(running.pid("hung"), signal.SIGSTOP)
    yield "a gateway that hangs, as on a hung disk"
    os.kill(running.pid("hung"), signal.SIGCONT)
    yield ALONE
    running.start(silent, sys.executable, "-c", SILENT, endpoint)
    wait_until(lambda: running.log(silent), "no silent logs", 60)
    yield "thirty logs that never answer"
    running.kill(silent)
    yield ALONE
    running.start(name, sys.executable, "-c", FLOOD, endpoint)
    wait_until(lambda: running.log(name), "no flood", 60)
    yield "a client that asks for logs without end, at nice 19"
    os.kill(running.pid(name), signal.SIGSTOP)
    yield "the same client, frozen while it takes its answers"
    running.kill(name)


def _row(what: str, late_ms: Sequence[np.ndarray], alone_ms: Sequence[np.ndarray]) -> str:
    """Of the same rounds, with the sickness and without; the intervals are a bootstrap over the rounds."""
    random, every = np.random.default_rng(1), np.arange(ROUNDS)

    def percentiles(of_ms: Sequence[np.ndarray], rounds: np.ndarray) -> np.ndarray:
        return np.percentile(np.concatenate([of_ms[number] for number in rounds]), PERCENTILES)

    def times(rounds: np.ndarray) -> np.ndarray:
        return percentiles(late_ms, rounds) / percentiles(alone_ms, rounds)

    drawn = [times(random.integers(ROUNDS, size=ROUNDS)) for _ in range(DRAWN)]
    bounds = zip(times(every), *np.percentile(drawn, (2.5, 97.5), axis=0), strict=True)
    figures = "".join(f"{figure:8.1f}" for figure in percentiles(late_ms, every))
    return figures + "".join(f"  {ratio:.2f} ({low:.2f}-{high:.2f})" for ratio, low, high in bounds) + f"  {what}"


def table() -> list[str]:
    """The rows under their heading."""
    heading = "  median     p95     p99" + "".join(f"  {what:<16}" for what in ("median", "p95", "p99"))
    return [f"{heading}  (ms; times that alone, and its interval)", *rows()]


if __name__ == "__main__":
    print(*table(), sep="\n")
