"""A host as noctule-deploy renders it, run here without systemd: its units' command lines in a folder of its own."""

import os
import re
import shlex
import shutil
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from system.processes import ROOT, Programs

_MOVED = ("/etc/noctule", "/var/lib/noctule")


@dataclass(frozen=True)
class RenderedHost:
    """``folder`` is the host's rendered folder, ``root`` is where its files stand in place of /."""

    folder: Path
    root: Path

    def install(self) -> None:
        """Put the files of the host into their places below the root."""
        shutil.copytree(self.folder / "etc", self.root / "etc")
        for path in (self.root / "etc/noctule").rglob("*"):
            if path.is_file() and path.suffix in (".json5", ".toml"):
                path.write_text(self._moved(path.read_text()))

    def services(self) -> list[str]:
        """The names of its units."""
        return sorted(path.stem for path in (self.root / "etc/systemd/system").iterdir())

    def start(self, running: Programs, service: str) -> None:
        """Start a unit's command under the system call filter of the unit: what it does not allow fails with EPERM."""
        denied = ",".join(f"?{call}" for call in sorted(_denied(self._unit(service))))
        traced = ("--seccomp-bpf", "--output", str(self.calls(service)), f"--trace={denied}")
        filtered = ("strace", "--follow-forks", "--quiet=all", *traced, f"--inject={denied}:error=EPERM")
        # As a detached tracer, strace leaves the program to be the process that is started and ended.
        running.start(service, *filtered, "--daemonize", "--", *self.command(service), env=self.environment(service))

    def calls(self, service: str) -> Path:
        """What the filter of a unit has refused."""
        return self.root / f"{service}.refused"

    def command(self, service: str) -> list[str]:
        """The command line of a unit, with the project's programs and the paths below the root."""
        (line,) = re.findall(r"^ExecStart=(.*)$", self._unit(service), re.MULTILINE)
        line = line.replace("/opt/noctule/bin/", f"{ROOT / '.venv/bin'}/").replace("%%", "%").replace("$$", "$")
        return shlex.split(self._moved(line))

    def environment(self, service: str) -> dict[str, str]:
        """What a unit adds to the environment of its command."""
        # Not the folder where Numba keeps what it has compiled: it is filled here already, elsewhere.
        lines = re.findall(r"^Environment=(?!NUMBA)(\w+)=(.*)$", self._unit(service), re.MULTILINE)
        return {name: self._moved(value) for name, value in lines}

    def _unit(self, service: str) -> str:
        return (self.root / f"etc/systemd/system/{service}.service").read_text()

    def _moved(self, text: str) -> str:
        for path in _MOVED:
            text = text.replace(path, f"{self.root}{path}")
        return text


def _denied(unit: str) -> frozenset[str]:
    """The system calls that the unit's filter lines do not allow, in systemd's own words and order."""
    allowed: frozenset[str] = frozenset()
    for line in re.findall(r"^SystemCallFilter=(.*)$", unit, re.MULTILINE):
        named = frozenset(call for word in line.lstrip("~").split() for call in _calls(word))
        allowed = allowed - named if line.startswith("~") else allowed | named
    return _calls("@known") - allowed


@cache
def _calls(word: str) -> frozenset[str]:
    """The system calls of a word of systemd's filters: a call, or a set of them."""
    if not word.startswith("@"):
        return frozenset((word,))
    printed = subprocess.run(
        ["systemd-analyze", "syscall-filter", word], capture_output=True, text=True, check=True, env=os.environ
    )
    lines = (line.strip() for line in printed.stdout.splitlines()[1:])
    return frozenset(call for line in lines if line and not line.startswith("#") for call in _calls(line))
