"""One gateway's logs and publishing, fed with sweeps at their cadence in the place of serial lines.

A sweep's start is the moment at which its last byte would have come over the line.
"""

import contextlib
import os
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
from mapper.live_site import message
from mapper.room import paper_path, paper_room, survey

from noctule import bus, site
from noctule.caller import Callers, Who
from noctule.messages_pb2 import CommandReply, CommandRequest, Sweep, UnitStatus
from noctule.newer_fields import NewerFields
from noctule_gateway.bus.held_bytes import HeldBytes
from noctule_gateway.bus.log_readers import LogReaders
from noctule_gateway.bus.outbox import Outbox
from noctule_gateway.bus.unit_on_bus import UnitOnBus
from noctule_gateway.clock.clock_watch import ClockWatch
from noctule_gateway.limits import allow_files
from noctule_gateway.log.log_file import Arrival, Committed, Retention
from noctule_gateway.log.sweep_log import SweepLog
from noctule_gateway.pose import PoseTrack
from noctule_gateway.served_unit import ServedUnit

RING_SWEEPS = 21  # a full ring of 13 readings each: firmware/README.md
STATUS_EVERY_S = 1.0
FLIGHT_NOISE_S = 1e-5


class StreamedUnit:
    """One unit: its log, what it has on the bus, and the ``made`` sweeps that it has sent so far."""

    def __init__(
        self,
        kept: ServedUnit,
        on_bus: UnitOnBus,
        seen: Sweep,
        rng: np.random.Generator,
        note: Callable[[str, int], None] | None = None,
    ) -> None:
        """``note`` gets unit and log_sequence of each sweep as soon as it is logged, before it is published."""
        self.name, self.log = f"{kept.site.name}/{kept.unit.name}", kept.log
        self._kept, self._on_bus, self._seen, self._rng = kept, on_bus, seen, rng
        self._note = note
        self.made = 0

    def sweep(self, start_ns: int | None = None) -> None:
        """Hand one sweep over, which began at ``start_ns`` (UTC) or, for all that is measured here, now."""
        self.made += 1
        sweep = Sweep()
        sweep.CopyFrom(self._seen)
        sweep.site, sweep.unit = self._kept.site.name, self._kept.unit.name
        sweep.boot, sweep.sequence = 1, self.made
        for reading, late_s in zip(
            sweep.readings, self._rng.normal(0, FLIGHT_NOISE_S, len(sweep.readings)), strict=True
        ):
            if reading.HasField("time_of_flight_s"):
                reading.time_of_flight_s += late_s
        sweep.start.FromNanoseconds(time.time_ns() if start_ns is None else start_ns)
        self.log.append(Arrival(self.made.to_bytes(16, "big"), self.made, sweep), self._done)

    def report(self) -> None:
        """Publish a status, as a gateway does each second."""
        status = UnitStatus(
            site=self._kept.site.name,
            unit=self._kept.unit.name,
            state=UnitStatus.STATE_SWEEPING,
            gateway="gateway",
            log_id=self.log.state.log_id,
            log_head=self.log.state.head,
            log_tail=self.log.state.tail,
        )
        status.time.GetCurrentTime()
        self._on_bus.report(status)

    def _done(self, result: object) -> None:
        if isinstance(result, Committed):
            if self._note is not None:
                self._note(self._kept.unit.name, result.log_sequence)
            self._on_bus.publish(result.record)


def open_units(
    data: Path,
    name: str,
    count: int,
    router: str,
    closing: contextlib.ExitStack,
    note: Callable[[str, int], None] | None = None,
) -> list[StreamedUnit]:
    """The units of one site, with the session, the outbox and the readers of a gateway."""
    rng = np.random.default_rng(41)
    places = [message(made) for made in survey(paper_room(), paper_path(), rng)]
    known = _site(data, name, count)
    session = closing.enter_context(bus.closing(bus.open_session([router])))
    outbox, readers = Outbox(), LogReaders()
    closing.callback(outbox.close)
    closing.callback(readers.close)
    opened = []
    folder = data / known.name
    folder.mkdir(parents=True)
    for index, unit in enumerate(known.units):
        log = SweepLog(folder / f"{unit.name}.sqlite", Retention())
        closing.callback(log.close)
        kept = ServedUnit(known, unit, log, PoseTrack(), ClockWatch(data / f"{known.name}.clock-epoch"))
        on_bus = UnitOnBus(
            session, kept, _refuse, outbox, readers, HeldBytes(), NewerFields(), Callers(), lambda *_: None
        )
        opened.append(StreamedUnit(kept, on_bus, places[index * len(places) // count], rng, note))
    return opened


def _site(data: Path, name: str, units: int) -> site.Site:
    file = data / f"{name}.toml"
    listed = (
        f'[[unit]]\nname = "u{number}"\nserial = {number}\naddress = "socket://127.0.0.1:{number}"\n'
        "pose = { x_m = 0.0, y_m = 0.0, heading_deg = 0.0 }\n"
        for number in range(1, units + 1)
    )
    file.write_text(f'site = "{name}"\nair_temperature_c = 21.0\n' + "".join(listed))
    return site.load(file)


def _refuse(_name: str, _request: CommandRequest, _who: Who) -> Future[CommandReply]:
    raise AssertionError("nobody commands the units of this bench")


def _in_turn(
    units: Sequence[StreamedUnit], every_s: float, stop: threading.Event, act: Callable[[StreamedUnit], None]
) -> None:
    """``act`` on each unit once in ``every_s``, spread evenly, until ``stop``."""
    due_s = time.monotonic()
    while True:
        for unit in units:
            due_s += every_s / len(units)
            if stop.wait(max(0.0, due_s - time.monotonic())):
                return
            act(unit)


def run(told: Connection, data: Path, site_name: str, count: int, sweep_s: float, router: str) -> None:
    """Serve ``count`` units until the pipe is closed: see gateways.py."""
    allow_files(count)
    stop_sweeps, stop_statuses = threading.Event(), threading.Event()
    with contextlib.ExitStack() as closing:
        place = Path(os.environ["BENCH_TIMES"]) / f"{site_name}.gateway"
        file = closing.enter_context(place.open("w", buffering=1))

        def note(unit: str, log_sequence: int) -> None:
            file.write(f"g {time.time_ns()} {unit} {log_sequence}\n")

        units = open_units(data, site_name, count, router, closing, note)
        workers = [
            threading.Thread(target=_in_turn, args=(units, sweep_s, stop_sweeps, StreamedUnit.sweep)),
            threading.Thread(target=_in_turn, args=(units, STATUS_EVERY_S, stop_statuses, StreamedUnit.report)),
        ]
        for worker in workers:
            worker.start()
        told.send("ready")
        with contextlib.suppress(EOFError):
            while word := told.recv():
                if word == "burst":
                    for _ in range(RING_SWEEPS):
                        for unit in units:
                            unit.sweep()
                elif word == "stop":
                    stop_sweeps.set()
                    workers[0].join()
                    told.send({unit.name: unit.made for unit in units})
        stop_sweeps.set()
        stop_statuses.set()
        for worker in workers:
            worker.join()
