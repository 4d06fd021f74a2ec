"""How many layouts a relay is given: it forgets none, and each takes memory."""

from collections import deque
from collections.abc import Callable
from time import monotonic

MOST, IN_S = 12, 6 * 3_600.0
_MOST_FOR_ONE_CAUSE = 9  # a map that grows on and on leaves three to new units, and new units three to the map
_EVERY_S = 10.0


class LayoutBudget:
    """Twelve layouts in six hours. ``now`` counts seconds evenly."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._taken: deque[tuple[float, bool]] = deque()

    def take(self, for_units: bool) -> bool:
        """Whether a layout may be sent now, ``for_units`` that are new or else for a map that has outgrown its box; it
        is counted then.
        """
        now_s = self._now()
        while self._taken and now_s - self._taken[0][0] >= IN_S:
            self._taken.popleft()
        same_cause = sum(of_units == for_units for _, of_units in self._taken)
        if len(self._taken) >= MOST or same_cause >= _MOST_FOR_ONE_CAUSE:
            return False
        if self._taken and now_s - self._taken[-1][0] < _EVERY_S:
            return False
        self._taken.append((now_s, for_units))
        return True
