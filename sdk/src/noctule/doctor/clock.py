"""The host's clock, by which every sweep gets its time."""

from collections.abc import Iterator

from noctule.doctor.finding import Finding, Level
from noctule.kernel_clock import KernelClock

WORST_ERROR_S = 0.1
_REMEDY = "install chrony or switch on systemd-timesyncd, and let the host reach a time server"


def check(clock: KernelClock, now_s: float, newest_file_s: float) -> Iterator[Finding]:
    """``now_s``: UTC by the clock; ``newest_file_s``: when the newest of the site's files was written, by the same."""
    if now_s < newest_file_s:
        behind_s = newest_file_s - now_s
        yield Finding(Level.FAULT, "clock", f"it is {behind_s:.0f} s behind a file that is there already: {_REMEDY}")
    elif not clock.synchronised:
        yield Finding(Level.WARNING, "clock", f"nothing synchronises it, so the times of sweeps drift: {_REMEDY}")
    elif clock.most_error_s > WORST_ERROR_S:
        text = f"its error may be {clock.most_error_s * 1e3:.0f} ms: see that the time server is reached"
        yield Finding(Level.WARNING, "clock", text)
    else:
        yield Finding(Level.OK, "clock", f"synchronised, error below {clock.most_error_s * 1e3:.0f} ms")
