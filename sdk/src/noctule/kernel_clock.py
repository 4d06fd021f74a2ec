"""What the kernel knows of the host's clock: whether a time server keeps it right, and how far off it may be."""

import ctypes
import os
from dataclasses import dataclass

_NOT_SYNCHRONISED = 0x40  # STA_UNSYNC, adjtimex(2)


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
