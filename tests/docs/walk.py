"""The command lines of the pages, typed in a folder as somebody would who reads them."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from docs.lines import LINES, LISTENS, PLACES, Typed
from system.processes import PATIENCE_S, ROOT, free_ports, listens, wait_until

_BUSY, _TRIES = "busy: ", 100  # a unit ends what it does before it takes another command
_ENDED_EARLY = -1  # for a status, of what should go on
_LONGEST_S = 5 * PATIENCE_S  # of a line that ends by itself


class Walk:
    """Types in ``folder``, on the bus at ``endpoint``. A line of make is typed in the folder of the project."""

    def __init__(self, folder: Path, endpoint: str) -> None:
        self.folder, self._endpoint = folder, endpoint
        self._environment = {name: value for name, value in os.environ.items() if "DISPLAY" not in name} | {
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "NOCTULE_CONNECT": endpoint,
            "HOME": str(folder),
            "PYTHONUNBUFFERED": "1",
        }

    def trouble(self, text: str) -> str:
        """Type a line, and return what goes wrong: a status that its page does not allow, a traceback, something that
        is not shown. Empty if all is well.
        """
        for _ in range(_TRIES):
            trouble = self._trouble_once(text)
            if _BUSY not in trouble:
                break
        if not trouble and "cd" in (words := text.split()):
            self.folder /= words[words.index("cd") + 1]
        return trouble

    def _trouble_once(self, text: str) -> str:
        typed, log = LINES.get(text, Typed()), self.folder / "printed"
        status = self._status(text, typed, log)
        printed = log.read_text()
        if status in typed.status and "Traceback" not in printed and re.search(typed.shows, printed):
            return ""
        return f"{text}: status {status}, printed:\n{printed}"

    def starts(self, text: str, log: Path, more: str = "", goes_on: bool = True) -> "subprocess.Popen[bytes]":
        """The line of a page, with ``more`` behind it, as a process that prints into ``log``."""
        line = f"{text} {more}"
        for place, ours in PLACES.items():
            line = re.sub(rf"(?<![^\s=]){place}\b", ours, line)
        with log.open("wb") as output:
            return subprocess.Popen(
                ["bash", "-c", f"exec {line}" if goes_on else line],  # else Ctrl-C would be for the shell
                cwd=ROOT if line.startswith("make") else self.folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # a group of its own, with all that the line starts
            )

    def _status(self, text: str, typed: Typed, log: Path) -> int:
        """The exit status of the line; one that goes on is ended by Ctrl-C when it has come far enough."""
        port, next_port, _ = free_ports(3)  # of the simulator's three units each takes one
        ours = {"endpoint": self._endpoint, "port": port, "next_port": next_port}

        def has_come() -> bool:
            if typed.until == LISTENS:
                return listens(port)
            files = self.folder.glob(typed.into) if typed.into else [log]
            return any(re.search(typed.until.encode(), file.read_bytes()) for file in files)

        line = typed.instead.format_map(ours) or text
        process = self.starts(line, log, typed.more.format_map(ours), goes_on=bool(typed.until))
        try:
            if typed.until:
                wait_until(lambda: has_come() or process.poll() is not None, f"{text} does not come to {typed.until}")
                if not has_come():
                    return process.wait(PATIENCE_S) or _ENDED_EARLY
                process.send_signal(signal.SIGINT)
            return process.wait(_LONGEST_S)
        finally:
            kill(process)


def kill(process: "subprocess.Popen[bytes]") -> None:
    """What starts() has started, with all of its line, if it has not ended."""
    if process.poll() is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
