"""A link and a model unit on one line, in a time of the test's own."""

from dataclasses import replace
from random import Random
from typing import TypeVar

from gateway.bad_line import BadLine, Faults
from gateway.model_unit import ModelUnit

from noctule_gateway.link.events import Event, OrderSettled, SweepRead
from noctule_gateway.link.link import Link
from noctule_gateway.link.standing_orders import Wanted
from noctule_gateway.unit.plans import OWN_PLAN
from noctule_gateway.wire import frames

E = TypeVar("E")

SERIAL = 7
STEP_S = 0.002
AT_REST = Wanted(plan=None, start=frames.Start(0, 0), running=False)
PLAN = replace(OWN_PLAN, count=5)
SWEEPING = Wanted(plan=PLAN, start=frames.Start(0, 250), running=True)


class Rig:
    """A link and a unit on one line; sweeps are committed by ``commit``, which says whether that went well."""

    def __init__(
        self,
        unit: ModelUnit,
        wanted: Wanted = AT_REST,
        faults: Faults | None = None,
        seed: int = 1,
        first: int = 40,
        serial: int = SERIAL,
    ) -> None:
        faults = faults or Faults()
        self.unit = unit
        self.link = Link(serial, wanted, first)
        self.now_s = 100.0
        self.events: list[Event] = []
        self.committed: list[frames.AnySweep] = []
        self.commit_fails = 0.0
        self._random = Random(seed)
        self._down, self._up = BadLine(faults, seed), BadLine(faults, seed + 1000)
        self.link.connected(self.now_s)

    def run(self, duration_s: float) -> list[Event]:
        """Let time pass; the events of that time."""
        begun = len(self.events)
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.now_s += STEP_S
            self._take(self.link.advance(self.now_s))
            self._down.write(self.link.output(self.now_s), self.now_s)
            self.unit.receive(self._down.read(self.now_s), self.now_s)
            self._up.write(self.unit.output(self.now_s), self.now_s)
            self._take(self.link.receive(self._up.read(self.now_s), self.now_s))
        return self.events[begun:]

    def cut(self, duration_s: float) -> list[Event]:
        """Let time pass without a line."""
        begun = len(self.events)
        end_s = self.now_s + duration_s
        while self.now_s < end_s:
            self.now_s += STEP_S
            self._take(self.link.advance(self.now_s))
            self.link.output(self.now_s)
        return self.events[begun:]

    def settled(self, ticket: int) -> OrderSettled:
        """What became of an order."""
        (event,) = (each for each in self.events if isinstance(each, OrderSettled) and each.ticket == ticket)
        return event

    def _take(self, events: list[Event]) -> None:
        self.events += events
        for event in events:
            if isinstance(event, SweepRead):
                if self._random.random() < self.commit_fails:
                    self.link.failed(event.sweep)
                else:
                    self.committed.append(event.sweep)
                    self.link.committed(event.sweep, self.now_s)


def with_lost_acknowledgement() -> tuple[Rig, ModelUnit]:
    """A link that has committed the unit's one sweep, and the unit, which still has it."""
    unit = ModelUnit(SERIAL)
    rig = Rig(unit)
    rig.run(1.0)
    sweep = unit.make_sweep(rig.now_s)
    rig.run(0.1)
    unit.ring.append(sweep)
    return rig, unit


def of_type(events: list[Event], kind: type[E]) -> list[E]:
    return [event for event in events if isinstance(event, kind)]
