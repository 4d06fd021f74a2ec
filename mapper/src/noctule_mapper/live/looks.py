"""Whether something goes on, seen by one who looks at it each second."""

STUCK_AFTER = 600  # looks at one sweep, fit or state; the longest fits take seconds


class Looks:
    """Counts looks in a row at which nothing had changed. For one thread.

    Looks are counted and not seconds: after a pause of the whole host, or of all its processes, nobody is late.
    """

    def __init__(self) -> None:
        self._mark: object = None
        self._unchanged = 0

    def unchanged(self, mark: object) -> int:
        """Look once. ``mark`` is what changes as long as things go on; 0 when it has changed since the last look."""
        self._unchanged = self._unchanged + 1 if mark == self._mark else 0
        self._mark = mark
        return self._unchanged
