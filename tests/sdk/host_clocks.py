"""A host's clocks as a test moves them: time passes, the wall clock is set, the kernel boots."""

from noctule.elapsed import Instant

DAY_S = 86400.0
NOON_S = 1_790_000_000.0  # some day of 2026


class Host:
    """Calling it gives the present instant."""

    def __init__(self) -> None:
        self.utc_s, self.boots, self.since_boot_s = NOON_S, 1, 1000.0

    def __call__(self) -> Instant:
        return Instant(self.utc_s, f"boot {self.boots}", self.since_boot_s)

    def pass_time(self, duration_s: float) -> None:
        self.utc_s += duration_s
        self.since_boot_s += duration_s

    def boot(self, off_s: float) -> None:
        self.utc_s += off_s
        self.boots += 1
        self.since_boot_s = 10.0
