"""A host of its own for a deployment: processes, ports, mounts and clock, all of them gone when its program ends."""

import fcntl
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_FAKETIME = "libfaketimeMT.so.1"
_UP_AND_RUNNING = 0x1 | 0x40  # IFF_UP, IFF_RUNNING
_CHUNK_BYTES = 1 << 16


def inside(arguments: Sequence[str]) -> list[str]:
    """The command that runs ``python -m`` with ``arguments`` on a host of its own. Needs root, or user namespaces."""
    root = [] if os.geteuid() == 0 else ["--map-root-user"]
    namespaces = ["--mount", "--net", "--pid", "--fork", "--kill-child", "--mount-proc"]
    return ["unshare", *root, *namespaces, sys.executable, "-m", *arguments]


def set_up() -> None:
    """Begin this host: loopback comes up, and shared memory is its own (libfaketime leaves files in it)."""
    with socket.socket() as any_socket:
        request = struct.pack("16sH14x", b"lo", _UP_AND_RUNNING)
        fcntl.ioctl(any_socket, 0x8914, request)  # SIOCSIFFLAGS
    mount(Path("/dev/shm"), 64)


def unmount(folder: Path) -> None:
    """Take the disk at ``folder`` away, with all that is on it."""
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def mount(folder: Path, size_mb: int) -> None:
    """A disk of its own at ``folder``; it goes with the host."""
    folder.mkdir(exist_ok=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_mb}m", "tmpfs", str(folder)], check=True)


def fill(folder: Path) -> None:
    """Write until the disk of ``folder`` has no byte left."""
    with (folder / "filler").open("ab", buffering=0) as filler:
        for size in (_CHUNK_BYTES, 1):
            try:
                while filler.write(bytes(size)) == size:
                    pass
            except OSError:
                continue


def empty(folder: Path) -> None:
    """Take out what fill() wrote."""
    (folder / "filler").unlink(missing_ok=True)


class WallClock:
    """The wall clock of programs that run with ``environment``. Their monotonic clock is the machine's."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self.set(0.0)

    @property
    def environment(self) -> dict[str, str]:
        """Of a program whose wall clock this is to be."""
        found = sorted(Path("/usr/lib").glob(f"*/faketime/{_FAKETIME}"))
        if not found:
            raise FileNotFoundError(f"{_FAKETIME} is not installed: sh deploy/packages.sh test")
        return {
            "LD_PRELOAD": str(found[0]),
            "FAKETIME_TIMESTAMP_FILE": str(self._file),
            "FAKETIME_CACHE_DURATION": "1",  # seconds until a program sees that it was set
            "FAKETIME_DONT_FAKE_MONOTONIC": "1",
            "NO_FAKE_STAT": "1",
        }

    def set(self, hours: float) -> None:
        """Have the clock run ``hours`` ahead of the machine's."""
        fresh = self._file.with_suffix(".new")
        fresh.write_text(f"{hours * 3600.0:+.0f}s\n")
        fresh.replace(self._file)
