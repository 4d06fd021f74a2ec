"""Whether a unit is served well: in time, over a line that does not corrupt much of what it carries."""

from math import inf

TOO_LATE_S = 0.5  # a unit takes a sweep for lost after that
WINDOW_S = 10.0

_KEPT = 0.98  # of what is remembered, per frame: some fifty frames, half a minute of a quiet unit
_BAD_FROM = 0.1  # of the frames; one that is hit now and then is what resends are for
_GOOD_FROM = 0.02


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


class LineQuality:
    """The share of the latest frames that could not be read. ``bad`` does not flicker where that is about a tenth."""

    def __init__(self) -> None:
        self.bad = False
        self._share = 0.0
        self._read = self._unreadable = 0

    def note(self, read: int, unreadable: int) -> None:
        """So many frames have come since the beginning that could, and could not, be read."""
        more_read, more_unreadable = read - self._read, unreadable - self._unreadable
        self._read, self._unreadable = read, unreadable
        more = more_read + more_unreadable
        if more:
            kept = _KEPT**more
            self._share = kept * self._share + (1 - kept) * more_unreadable / more
        self.bad = self._share > (_GOOD_FROM if self.bad else _BAD_FROM)
