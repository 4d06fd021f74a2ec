"""A host of its own for a deployment: processes, ports, mounts and clock, all of them gone when its program ends."""

import fcntl
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_UP_AND_RUNNING = 0x1 | 0x40  # IFF_UP, IFF_RUNNING
_CHUNK_BYTES = 1 << 16


def inside(arguments: Sequence[str]) -> list[str]:
    """The command that runs ``python -m`` with ``arguments`` on a host of its own. Needs root, or user namespaces."""
    root = [] if os.geteuid() == 0 else ["--map-root-user"]
    namespaces = ["--mount", "--net", "--pid", "--fork", "--kill-child", "--mount-proc"]
    return ["unshare", *root, *namespaces, sys.executable, "-m", *arguments]


def set_up() -> None:
    """Begin this host: loopback comes up."""
    with socket.socket() as any_socket:
        request = struct.pack("16sH14x", b"lo", _UP_AND_RUNNING)
        fcntl.ioctl(any_socket, 0x8914, request)  # SIOCSIFFLAGS


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
    """The wall clock of programs that run with ``environment``. Their other clocks are the machine's."""

    def __init__(self, folder: Path) -> None:
        """Its file and its library are made in ``folder``, which must be there as long as those programs run."""
        self._file, library = folder.resolve() / "wall-clock", folder.resolve() / "wall_clock.so"
        self._file.write_bytes(bytes(8))
        source = Path(__file__).with_name("wall_clock.c")
        subprocess.run(["gcc", "-O2", "-shared", "-fPIC", "-o", str(library), str(source), "-ldl"], check=True)
        self.environment = {"LD_PRELOAD": str(library), "WALL_CLOCK_FILE": str(self._file)}

    def set(self, hours: float) -> None:
        """Have the clock run ``hours`` ahead of the machine's, from now on."""
        with self._file.open("r+b", buffering=0) as file:
            file.write(round(hours * 3600.0).to_bytes(8, sys.byteorder, signed=True))
