"""The real firmware in noctule-sim, run step by step on simulated time: nothing here waits for a clock."""

import json
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from system.processes import PATIENCE_S

from noctule_gateway.wire.codec import FrameReader, encode
from noctule_gateway.wire.frames import (
    Ack,
    Ack2,
    AnySweep,
    AskHello,
    Enquiry,
    Frame,
    Hello,
    HostFrame,
    LoaderOrder,
    Order,
    Result,
    Status,
    Sweep,
)

IMAGE = Path(__file__).parents[2] / "firmware" / "build" / "noctule.ihx"

TICK_S = 1 / 48e6  # of simulated time

F = TypeVar("F", bound=Frame)
G = TypeVar("G", bound=Frame)


class SilenceError(AssertionError):
    """What was awaited did not come in time."""


class SteppedUnit:
    """One unit and the cable to it; ``now_s`` is the simulated time since power-up, ``truth`` how things are then."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._reader = FrameReader()
        self._heard: list[Frame] = []
        self._request = 0
        self.now_s = 0.0
        self.truth: dict[str, Any] = {}  # how things are, as the simulator knows them

    def step(self, **request: Any) -> bytes:
        """One request of ``noctule-sim --control``; what the unit has sent."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        assert line, f"the simulator has ended with status {self._process.wait(PATIENCE_S)}"
        answer = json.loads(line)
        self.now_s = answer["now_s"]
        self.truth = answer["truth"][0]
        return bytes.fromhex(answer["sent"][0])

    def run(self, duration_s: float) -> bytes:
        """Let time pass; what the unit has sent meanwhile is kept for receive() too."""
        sent = self.step(until_s=self.now_s + duration_s)
        self._heard += self._reader.feed(sent)
        return sent

    def inject(self, kind: str, **details: Any) -> None:
        """Inject a fault of the simulator's README, now."""
        self.step(fault={"kind": kind, **details})

    def send_bytes(self, data: bytes) -> None:
        """Put bytes on the cable, from now on."""
        self.step(feed=[data.hex()])

    def send(self, frame: HostFrame) -> None:
        """Put a frame on the cable, as it is."""
        self.send_bytes(encode(frame))

    def receive(self, frame_type: type[F], within_s: float = 10.0) -> F:
        """The next frame of this type; those before it are passed over."""
        return self.receive_either(frame_type, frame_type, within_s)

    def receive_either(self, one: type[F], other: type[G], within_s: float = 10.0) -> F | G:
        """The next frame of one of two types; those before it are passed over."""
        end_s = self.now_s + within_s
        while True:
            for place, frame in enumerate(self._heard):
                if isinstance(frame, (one, other)):
                    del self._heard[: place + 1]
                    return frame
            self._heard.clear()
            if self.now_s >= end_s - TICK_S:  # the simulator rounds to whole ticks
                names = " or ".join({one.__name__, other.__name__})
                raise SilenceError(f"no {names} within {within_s} s of simulated time")
            self._heard += self._reader.feed(self.step(until_s=end_s, stop_at_frame=True))

    def take(self, frame_type: type[F]) -> list[F]:
        """The frames of this type that have come by now; the others are forgotten."""
        taken = [frame for frame in self._heard if isinstance(frame, frame_type)]
        self._heard.clear()
        return taken

    def ask(self, frame: Enquiry | Order | LoaderOrder, answer: type[F], within_s: float = 2.0) -> F:
        """The answer to a new request, which is numbered here."""
        self._request = self._request % 255 + 1
        self.send(replace(frame, request=self._request))
        end_s = self.now_s + within_s
        while True:
            found: Any = self.receive(answer, end_s - self.now_s)
            if found.request == self._request:
                return found

    def command(self, order: Order | LoaderOrder, within_s: float = 2.0) -> int:
        """What the unit says has become of ``order``, an Outcome."""
        return self.ask(order, Result, within_s).result

    def greet(self) -> Hello:
        """Wait for the unit to have started, and say hello."""
        self.receive(Hello)
        return self.ask(AskHello(0), Hello)

    def greet_again(self) -> Hello:
        """Say hello to a unit that has started."""
        return self.ask(AskHello(0), Hello)

    def wait_for_state(self, state: int, within_s: float = 60.0) -> Status:
        """The STATUS that the unit sends unasked and that says it is in ``state``."""
        end_s = self.now_s + within_s
        while (status := self.receive(Status, end_s - self.now_s)).state != state:
            pass
        return status

    def acknowledge(self, sweep: AnySweep) -> None:
        """Tell the unit that it may forget ``sweep``."""
        if isinstance(sweep, Sweep):
            self.send(Ack(sweep.boot, sweep.sequence, sweep.serial, sweep.life))
        else:
            self.send(Ack2(sweep.boot, sweep.sequence))


@contextmanager
def stepped_unit(*options: str, image: Path = IMAGE) -> Iterator[SteppedUnit]:
    """A unit that has just been given power, in noctule-sim with these ``options``; its clock is exact."""
    command = ["noctule-sim", "--control", "--exact-clocks", "--firmware", str(image), *options]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        yield SteppedUnit(process)
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(PATIENCE_S) == 0
