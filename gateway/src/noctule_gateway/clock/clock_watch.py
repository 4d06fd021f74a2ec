"""Whether the host's wall clock was set, which the operator of a gateway should know: its sweeps carry that time."""

from noctule.elapsed import Instant

SHOWN_S = 600.0
_SET_S = 2.0  # a busy machine may read the two clocks some time apart


class ClockWatch:
    """Compares the wall clock with the time since the kernel's boot.

    ``sets`` counts how often it was set, ``detail`` says so for SHOWN_S and is empty otherwise.
    """

    def __init__(self) -> None:
        self.sets = 0
        self.detail = ""
        self._offset_s: float | None = None
        self._shown_until_s = 0.0

    def note(self, now: Instant) -> bool:
        """Take in what the clocks show now; True if the wall clock was set since the last call."""
        offset_s = now.utc_s - now.since_boot_s
        before_s, self._offset_s = self._offset_s, offset_s
        if before_s is None or abs(offset_s - before_s) < _SET_S:
            if now.since_boot_s > self._shown_until_s:
                self.detail = ""
            return False
        way = "forward" if offset_s > before_s else "back"
        self.detail = (
            f"the host's clock was set {way} by {abs(offset_s - before_s):.0f} s: "
            "sweeps logged before have times of the old clock"
        )
        self.sets += 1
        self._shown_until_s = now.since_boot_s + SHOWN_S
        return True
