"""What the kernel knows of the host's clock: whether a time server keeps it right, and how far off it may be."""

import ctypes
import os
from dataclasses import dataclass

WORST_ERROR_S = 0.1
REMEDY = "install chrony or switch on systemd-timesyncd, and let the host reach a time server"

_NOT_SYNCHRONISED = 0x40  # STA_UNSYNC, adjtimex(2)


@dataclass(frozen=True)
class KernelClock:
    """What the kernel knows of its clock."""

    synchronised: bool
    most_error_s: float

    @property
    def fault(self) -> str:
        """What is wrong with it, and what to do; empty if nothing is."""
        if not self.synchronised:
            return f"nothing synchronises it, so the times of sweeps drift: {REMEDY}"
        if self.most_error_s > WORST_ERROR_S:
            return f"its error may be {self.most_error_s * 1e3:.0f} ms: see that the time server is reached"
        return ""


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
