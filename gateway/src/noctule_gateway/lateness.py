"""How late a unit is served: what tells that a gateway can't keep up before its units' rings are full."""

from math import inf

TOO_LATE_S = 0.5  # a unit takes a sweep for lost after that
WINDOW_S = 10.0


class Lateness:
    """The longest delays of two windows, the later of which ends at a turn."""

    def __init__(self) -> None:
        self._older_s = self._newer_s = 0.0
        self._turn_s = -inf

    def note(self, late_s: float, now_s: float) -> None:
        """Something was done ``late_s`` after it was due."""
        if now_s >= self._turn_s:
            self._older_s, self._newer_s = self.worst_s(now_s), 0.0
            self._turn_s = now_s + WINDOW_S
        self._newer_s = max(self._newer_s, late_s)

    def worst_s(self, now_s: float) -> float:
        """The longest delay of the last 10 to 20 s."""
        if now_s < self._turn_s:
            return max(self._older_s, self._newer_s)
        return self._newer_s if now_s < self._turn_s + WINDOW_S else 0.0

    def too_late(self, now_s: float) -> bool:
        """Units take their sweeps for lost."""
        return self.worst_s(now_s) > TOO_LATE_S
