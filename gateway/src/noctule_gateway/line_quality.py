"""Whether a line corrupts so much that its operator should look at the cable."""

_KEPT = 0.98  # of what is remembered, per frame: some fifty frames, half a minute of a quiet unit
_BAD_FROM = 0.1  # of the frames; one that is hit now and then is what resends are for
_GOOD_FROM = 0.02


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
