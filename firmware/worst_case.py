"""The worst that the firmware can meet: the slowest chip, a full ring that memory spoils, a line never silent, STORE.

What it asks of the chip then, in noctule-sim: the longest rounds for budget.py.
"""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import IO, TypeVar

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    Ack,
    AskHello,
    AskStatus,
    Configure,
    Frame,
    HostFrame,
    Outcome,
    Result,
    Start,
    State,
    Status,
    Stop,
    Store,
    Sweep,
)

OPTIONS = ("--control", "--exact-clocks", "--laps", "0", "--slowest-chip", "--measure")
# The most readings, as quick as can be.
LONGEST_SWEEPS = Configure(2, -24576, 700, 64, 29, 800, 50, 0, 1)
FILLING_S = 60
# src/core/ring.c: where its slots begin, what a sweep of 64 readings fills, a byte of its readings.
RING, SLOT, SLOTS, IN_READINGS = 0x040C, 552, 5, 40
PERIOD_TICKS = 200_000  # of the turns: 50 ms
BURST_S = 0.1
BURST_BYTES = 1130  # of the 1152 that the line takes in that time: acknowledgements must get through too
BURSTS = 100
LONGEST_GARBAGE = 200

F = TypeVar("F", bound=Frame)


@dataclass
class Simulation:
    """A unit in ``noctule-sim``, and what its last answer said."""

    requests: IO[str]
    answers: IO[str]
    now_s: float = 0.0
    longest_work_us: float = 0.0
    resets: int = 0
    measured: str = ""
    _reader: FrameReader = field(default_factory=FrameReader)

    def run(self, duration_s: float, *frames: HostFrame, data: bytes = b"") -> list[Frame]:
        """Put these on the line and let time pass; what the unit has sent meanwhile."""
        data += b"".join(encode(frame) for frame in frames)
        return self._step(feed=[data.hex()], until_s=self.now_s + duration_s)

    def spoil(self, address: int) -> None:
        """Flip all bits of a byte of XRAM."""
        self._step(fault={"kind": "memory_spoiled", "address": address})

    def _step(self, **request: object) -> list[Frame]:
        self.requests.write(json.dumps(request) + "\n")
        self.requests.flush()
        answer = json.loads(self.answers.readline())
        truth = answer["truth"][0]
        self.now_s, self.measured = answer["now_s"], answer["measured"][0]
        self.longest_work_us, self.resets = truth["longest_work_us"], truth["resets"]
        return list(self._reader.feed(bytes.fromhex(answer["sent"][0])))


@contextmanager
def simulation(image: Path, *options: str) -> Iterator[Simulation]:
    command = ["noctule-sim", "--firmware", str(image), *OPTIONS, *options]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        yield Simulation(process.stdin, process.stdout)


def of_type(frame_type: type[F], frames: list[Frame]) -> list[F]:
    return [frame for frame in frames if isinstance(frame, frame_type)]


def burst(noise: Random) -> bytes:
    """Requests that want answers, and garbage between them, for ``BURST_S`` of the line."""
    data = b""
    while len(data) < BURST_BYTES:
        garbage = noise.randbytes(noise.randrange(LONGEST_GARBAGE)).replace(b"\0", b"\1")
        data += encode(AskStatus(noise.randrange(1, 256))) + garbage + b"\0"
    return data[:BURST_BYTES]


def flood(unit: Simulation) -> list[int]:
    """Keep the line full, but while a sweep is acknowledged; the sequences of those that have come meanwhile."""
    noise, came = Random(1), []
    for _ in range(BURSTS):
        sweeps = of_type(Sweep, unit.run(BURST_S, data=burst(noise)))
        came += [sweep.sequence for sweep in sweeps]
        for sweep in sweeps:
            unit.run(0.01, data=b"\0" + encode(Ack(sweep.boot, sweep.sequence, sweep.serial, sweep.life)))
    return came


def worst_case(image: Path, *options: str) -> tuple[str, float]:
    """What ``noctule-sim --measure`` says with these ``options``, of all but STORE, in which a page is erased.

    And the longest work between two feedings of the watchdog in us, STORE included: the watchdog stands still while
    flash is erased and written.
    """
    with simulation(image, *options) as unit:
        unit.run(1.0)
        unit.run(FILLING_S, AskHello(1), LONGEST_SWEEPS, Start(3, 0))
        status = of_type(Status, unit.run(0.1, AskStatus(4)))[-1]
        assert (status.state, status.sweeps_waiting) == (State.WAITING, SLOTS), status
        unit.run(0.1, Start(5, 0, status.tick, PERIOD_TICKS))
        spoiled = set(range(1, SLOTS))  # and sweep 0, which may be on its way already
        for slot in range(SLOTS):
            unit.spoil(RING + slot * SLOT + IN_READINGS)
        came = flood(unit)
        assert came and max(came) >= SLOTS, came
        assert not spoiled & set(came), f"spoiled sweeps have come: {came}"
        unit.run(5.0, Stop(6), data=b"\0")  # which ends the garbage
        measured = unit.measured
        results = of_type(Result, unit.run(1.0, Store(7)))
        assert [result.result for result in results] == [Outcome.DONE], results
        assert unit.resets == 0
        return measured, unit.longest_work_us
