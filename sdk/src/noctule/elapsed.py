"""Time that has passed, whatever the wall clock is set to: the age of what a log or a store keeps goes by it.

It advances by CLOCK_BOOTTIME while one boot of the kernel lasts, also across restarts of the service. How long the
machine was off between two boots only a wall clock could tell, so that time does not count: records are kept longer
than their age says, never shorter.
"""

import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Instant:
    """What the host's clocks show at one moment. The wall clock may be wrong, and may be set at any time."""

    utc_s: float
    kernel_boot: str  # the id of the kernel's present boot
    since_boot_s: float  # since that boot, sleep included


def now() -> Instant:
    """What the host's clocks show now."""
    kernel_boot = _kernel_boot()
    return Instant(time.time(), kernel_boot, time.clock_gettime(time.CLOCK_BOOTTIME))


@cache
def _kernel_boot() -> str:
    return Path("/proc/sys/kernel/random/boot_id").read_text().strip()


@dataclass(frozen=True)
class Elapsed:
    """Seconds that a log or a store has counted since its birth, and the clock by which it counted last."""

    seconds: float
    kernel_boot: str
    since_boot_s: float

    def at(self, instant: Instant) -> "Elapsed":
        """The count at ``instant``; it never goes back."""
        passed_s = instant.since_boot_s - self.since_boot_s if instant.kernel_boot == self.kernel_boot else 0.0
        return Elapsed(self.seconds + max(passed_s, 0.0), instant.kernel_boot, instant.since_boot_s)
