"""Whose picture is drawn next: however many units there are, they share one rate."""

from collections.abc import Callable, Mapping
from time import monotonic

DRAWN_AGAIN_AFTER_S = 300.0  # a relay forgets its oldest drawings


class Turns:
    """One unit in ``every_s``, by the clock ``now``."""

    def __init__(self, every_s: float, now: Callable[[], float] = monotonic) -> None:
        self._every_s, self._now = every_s, now
        self._next_s = now()
        self._drawn: dict[str, tuple[float, float]] = {}  # by unit: when, and which state of it

    def take(self, states: Mapping[str, float]) -> str | None:
        """The unit whose turn it is, of those whose state is another than when they were last drawn, or was drawn long
        ago. It is noted as drawn, and units without a state are forgotten.
        """
        now_s = self._now()
        self._drawn = {unit: drawn for unit, drawn in self._drawn.items() if unit in states}
        due = [unit for unit in states if self._is_due(unit, states[unit], now_s)]
        if not due or now_s < self._next_s:
            return None
        self._next_s = now_s + self._every_s
        unit = min(due, key=lambda one: self._drawn.get(one, (-1.0, 0.0))[0])
        self._drawn[unit] = now_s, states[unit]
        return unit

    def _is_due(self, unit: str, state: float, now_s: float) -> bool:
        if unit not in self._drawn:
            return True
        drawn_s, drawn_state = self._drawn[unit]
        return drawn_state != state or now_s - drawn_s >= DRAWN_AGAIN_AFTER_S
