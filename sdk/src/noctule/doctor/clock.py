"""The host's clock, by which every sweep gets its time."""

import ctypes
import os
from collections.abc import Iterator
from dataclasses import dataclass

from noctule.doctor.finding import Finding, Level

WORST_ERROR_S = 0.1
_NOT_SYNCHRONISED = 0x40  # STA_UNSYNC, adjtimex(2)
_REMEDY = "install chrony or switch on systemd-timesyncd, and let the host reach a time server"


@dataclass(frozen=True)
class KernelClock:
    """What the kernel knows of its clock."""

    synchronised: bool
    most_error_s: float


class _Timex(ctypes.Structure):
    """The beginning of struct timex, adjtimex(2); the rest is not read."""

    _fields_ = [
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),  # microseconds
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    ]


def kernel_clock() -> KernelClock:
    """Ask the kernel. Raises OSError where it does not tell."""
    libc, timex = ctypes.CDLL(None, use_errno=True), _Timex()
    if libc.adjtimex(ctypes.byref(timex)) < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return KernelClock(not timex.status & _NOT_SYNCHRONISED, timex.maxerror * 1e-6)


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
