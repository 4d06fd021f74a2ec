"""Where the kernel and udev show the state of a host; tests give folders of their own."""

import grp
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Host:
    """Folders of a host, and the user (``uid``, ``gids``) for whom the checks are made."""

    dev: Path = Path("/dev")
    sys: Path = Path("/sys")
    proc: Path = Path("/proc")
    udev: Path = Path("/run/udev/data")
    uid: int = os.getuid()
    gids: frozenset[int] = frozenset({os.getgid(), *os.getgroups()})

    def processes(self) -> Iterator[tuple[int, str]]:
        """Number and name of each process."""
        for folder in sorted(self.proc.glob("[0-9]*")):
            try:
                yield int(folder.name), (folder / "comm").read_text().strip()
            except (OSError, ValueError):
                continue  # it has just ended

    def holders(self, file: Path) -> list[tuple[int, str]]:
        """The processes that have ``file`` open, as far as this user may know."""
        return [(pid, name) for pid, name in self.processes() if file.resolve() in self._open_files(pid)]

    def may_use(self, file: Path) -> bool:
        """Whether the user may read and write ``file``, by its mode."""
        state = file.stat()
        shift = 6 if state.st_uid == self.uid else 3 if state.st_gid in self.gids else 0
        return self.uid == 0 or (state.st_mode >> shift) & 0o6 == 0o6

    def _open_files(self, pid: int) -> set[Path]:
        try:
            return {link.readlink() for link in (self.proc / str(pid) / "fd").iterdir()}
        except OSError:
            return set()


def group_of(file: Path) -> str:
    """The name of the file's group, or its number where it has no name."""
    gid = file.stat().st_gid
    try:
        return grp.getgrgid(gid).gr_name
    except KeyError:
        return str(gid)
