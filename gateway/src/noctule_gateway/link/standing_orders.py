"""What a unit is told after each of its boots, and when a gateway first meets it: its plan, and to start.

It begins as the site file says; an operator's configure, start and stop change it for as long as the gateway runs.
"""

from collections import deque
from dataclasses import dataclass, replace
from math import inf

from noctule_gateway.wire.frames import Configure, Order, Outcome, Result, Start, Status, Stop

_BUSY_RETRY_S = 0.5


@dataclass(frozen=True)
class Wanted:
    """What a unit is to do: its plan (None: its own), how it is started, and whether it is."""

    plan: Configure | None
    start: Start
    running: bool


class StandingOrders:
    """The orders that make a unit do what is wanted, one after the other. ``error`` says which one the unit refused."""

    def __init__(self, wanted: Wanted) -> None:
        self._wanted = wanted
        self._orders: deque[Order] = deque()
        self._awaits_status = True
        self._not_before_s = 0.0
        self._started = False
        self.error = ""

    def begin(self, status: Status) -> None:
        """Plan the orders for a unit that is in ``status``. A plan is only taken at rest; one found running goes on."""
        self.error = ""
        self._awaits_status = False
        self._orders.clear()
        if self._wanted.plan is not None:
            self._orders.extend([Stop(0)] if status.started else [])
            self._orders.append(self._wanted.plan)
        self._started = self._wanted.running or status.started
        if self._started:
            self._orders.append(self._wanted.start)

    def start_again(self) -> None:
        """Have the unit told once more how it is started, if it is."""
        if self._started and self.done:
            self._orders.append(self._wanted.start)

    def drop(self) -> None:
        """Forget what was still to be ordered, until begin()."""
        self._orders.clear()
        self._awaits_status = True

    @property
    def awaits_status(self) -> bool:
        """It takes the unit's status, by begin(), to say what is to be ordered."""
        return self._awaits_status

    @property
    def done(self) -> bool:
        """Nothing is left to order."""
        return not self._awaits_status and not self._orders

    @property
    def plan_to_give(self) -> Configure | None:
        """The plan that the unit is still to be given."""
        return next((each for each in self._orders if isinstance(each, Configure)), None)

    @property
    def due_s(self) -> float:
        """When the next order is due; infinity when there is none."""
        return self._not_before_s if self._orders else inf

    @property
    def order(self) -> Order:
        """The next order; there must be one."""
        return self._orders[0]

    def settle(self, result: Result | None, now_s: float) -> None:
        """Take in what became of ``order``; None is no answer. What was busy is asked again."""
        if result is None or result.result == Outcome.BUSY:
            self._not_before_s = now_s + _BUSY_RETRY_S
        elif result.result == Outcome.DONE:
            self._orders.popleft()
        else:
            order = self._orders.popleft()
            self._orders.clear()
            self.error = f"the unit refused what the site file wants: {describe(result)} ({order})"

    def learn(self, order: Order) -> None:
        """An operator's order was carried out: a unit that resets is brought back to it."""
        plan = self.plan_to_give
        match order:
            case Configure():
                self._wanted = replace(self._wanted, plan=order)
                self._orders = deque(each for each in self._orders if not isinstance(each, Configure))
            case Start():
                self._wanted = replace(self._wanted, start=order, running=True)
                self._started = True
                self._orders = deque([Stop(0), plan, order] if plan else [])
            case Stop():
                self._wanted = replace(self._wanted, running=False)
                self._started = False
                self._orders = deque([plan] if plan else [])


_OUTCOMES: dict[int, str] = {
    Outcome.DONE: "done",
    Outcome.BUSY: "busy: stop it, or wait until it is idle",
    Outcome.OUT_OF_RANGE: "a value is out of range: see firmware/README.md, Host to unit",
    Outcome.NOT_HOMED: "not homed: home it first",
    Outcome.FLASH_FAILED: "the flash did not take it: try again, and replace the unit if it stays so",
    Outcome.NOT_FOR_THIS_UNIT: "it was meant for another unit: check the serial number",
}


def describe(result: Result) -> str:
    """A unit's answer in words."""
    return _OUTCOMES.get(result.result, f"result {result.result}")
