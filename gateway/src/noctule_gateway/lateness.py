"""How late a unit is served: what tells that a gateway can't keep up before its units' rings are full."""

from math import inf

TOO_LATE_S = 0.5  # a unit takes a sweep for lost after that
_WINDOW_S = 10.0


class Lateness:
    """The longest delay of the last 10 to 20 s."""

    def __init__(self) -> None:
        self._older_s = self._newer_s = 0.0
        self._turn_s = -inf

    def note(self, late_s: float, now_s: float) -> None:
        """Something was done ``late_s`` after it was due."""
        if now_s >= self._turn_s:
            self._older_s = self._newer_s if now_s < self._turn_s + _WINDOW_S else 0.0
            self._newer_s = 0.0
            self._turn_s = now_s + _WINDOW_S
        self._newer_s = max(self._newer_s, late_s)

    @property
    def worst_s(self) -> float:
        """The longest delay."""
        return max(self._older_s, self._newer_s)
