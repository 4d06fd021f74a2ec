"""The command lines of the pages, typed in a folder as somebody would who reads them."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

from docs.lines import LINES, LISTENS, PLACES, Typed
from system.processes import PATIENCE_S, ROOT, free_ports, listens, wait_until

_BUSY = "busy: "  # a unit ends what it does before it takes another command; the test's own timeout ends the wait
_CUT_SHORT = "ended as it is; nothing stored is lost"  # a service that a loaded machine does not let end in 4 s
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
        typed, log = LINES.get(text, Typed()), self.folder / "printed"
        while True:
            status = self._status(text, typed, log)
            printed = log.read_text()
            ended = status in typed.status or (typed.until and _CUT_SHORT in printed)
            if not ended or "Traceback" in printed or not re.search(typed.shows, printed):
                if _BUSY in printed:
                    continue
                return f"{text}: status {status}, printed:\n{printed}"
            if "cd" in (words := text.split()):
                self.folder /= words[words.index("cd") + 1]
            return ""

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
            )

    def _status(self, text: str, typed: Typed, log: Path) -> int:
        """The exit status of the line; one that goes on is ended by Ctrl-C when it has come far enough."""
        port, next_port = free_ports(2)
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
            process.kill()
