"""The orders for one unit: the caller's in their turn, else the standing ones; one is on its way at a time."""

from collections import deque
from dataclasses import dataclass
from math import inf

from noctule_gateway.errors import CommandError
from noctule_gateway.link.events import Event, OrderSettled
from noctule_gateway.link.standing_orders import StandingOrders, describe
from noctule_gateway.wire.frames import (
    Calibrate,
    Configure,
    Order,
    Outcome,
    Reset,
    Result,
    Stop,
    Store,
    TrimTemperature,
)

CHANGES_SETTINGS = (Configure, Calibrate, TrimTemperature, Store)


@dataclass(frozen=True)
class _Given:
    """An order and the ticket that its caller knows it by; None is a standing one's."""

    order: Order
    ticket: int | None


class OrderQueue:
    """Orders that wait, and the one that was given and is not settled. What becomes of each is told by OrderSettled."""

    def __init__(self, standing: StandingOrders) -> None:
        self._standing = standing
        self._waiting: deque[_Given] = deque()
        self._given: _Given | None = None
        self._tickets = 0

    @property
    def given(self) -> Order | None:
        """The order on its way."""
        return self._given.order if self._given else None

    @property
    def changes_settings(self) -> bool:
        """The unit's settings will not be what they are, by an order of the caller's."""
        asked = (self._given, *self._waiting)
        return any(each and each.ticket is not None and isinstance(each.order, CHANGES_SETTINGS) for each in asked)

    @property
    def due_s(self) -> float:
        """When the next order is due."""
        return -inf if self._waiting else self._standing.due_s

    def add(self, order: Order) -> int:
        """Let ``order`` wait for its turn; its ticket. A stop goes before all that wait: they may be many."""
        self._tickets += 1
        given = _Given(order, self._tickets)
        if isinstance(order, Stop):
            self._waiting.appendleft(given)
        else:
            self._waiting.append(given)
        return self._tickets

    def withdraw(self, ticket: int) -> None:
        """Forget an order that still waits; nothing is told of it. One that is on its way goes on."""
        self._waiting = deque(each for each in self._waiting if each.ticket != ticket)

    def give(self) -> Order:
        """The order that is due now is on its way."""
        self._given = self._waiting.popleft() if self._waiting else _Given(self._standing.order, None)
        return self._given.order

    def settle(self, result: Result | None, now_s: float) -> list[Event]:
        """The order on its way was answered, or is given up with None."""
        given, self._given = self._given, None
        assert given is not None
        if given.ticket is None:
            self._standing.settle(result, now_s)
            return []
        if result is None:
            return [OrderSettled(given.order, given.ticket, CommandError("the unit did not answer"))]
        if result.result != Outcome.DONE:
            return [OrderSettled(given.order, given.ticket, CommandError(describe(result)))]
        self._standing.learn(given.order)
        return [OrderSettled(given.order, given.ticket, None)]

    def unit_was_reset(self) -> list[Event]:
        """An order to reset is carried out when the unit shows that it was, whether it has answered or not."""
        given = self._given
        if given is None or given.ticket is None or not isinstance(given.order, Reset):
            return []
        self._given = None
        return [OrderSettled(given.order, given.ticket, None)]

    def fail(self, why: str) -> list[Event]:
        """Nothing that waits or is on its way will be carried out, as far as can be told."""
        lost = [given for given in (self._given, *self._waiting) if given is not None]
        self._given = None
        self._waiting.clear()
        return [OrderSettled(each.order, each.ticket, CommandError(why)) for each in lost if each.ticket is not None]
