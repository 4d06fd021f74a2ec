"""The host's clock, by which every sweep gets its time."""

from collections.abc import Iterator

from noctule.doctor.finding import Finding, Level
from noctule.kernel_clock import REMEDY, KernelClock


def check(clock: KernelClock, now_s: float, newest_file_s: float) -> Iterator[Finding]:
    """``now_s``: UTC by the clock; ``newest_file_s``: when the newest of the site's files was written, by the same."""
    if now_s < newest_file_s:
        behind_s = newest_file_s - now_s
        yield Finding(Level.FAULT, "clock", f"it is {behind_s:.0f} s behind a file that is there already: {REMEDY}")
    elif clock.fault:
        yield Finding(Level.WARNING, "clock", clock.fault)
    else:
        yield Finding(Level.OK, "clock", f"synchronised, error below {clock.most_error_s * 1e3:.0f} ms")
