"""Lines of several processes on standard output, each with its process's name in front.

A thread of its own writes them: a terminal that is stopped (Ctrl-S) or slow holds up no process. Lines that it can't
take in time are left out and counted.
"""

import os
import queue
import select
import sys
import threading
from collections.abc import Callable, Sequence

_STDOUT = 1
_LINES = 2000  # what waits for a stopped terminal
_LOOK_EVERY_S = 0.5
_COLOURS = (36, 33, 32, 35, 34, 31)


class Terminal:
    """Standard output. ``gone`` is called when nobody reads it any more: a closed window, a pipe without reader."""

    def __init__(self, names: Sequence[str], gone: Callable[[], None]) -> None:
        self._gone = gone
        width = max(map(len, names))
        self._labels = {name: f"{name:{width}} | " for name in names}
        if sys.stdout.isatty() and not os.environ.get("NO_COLOR"):
            for name, colour in zip(names, _COLOURS, strict=False):
                self._labels[name] = f"\033[{colour}m{self._labels[name]}\033[0m"
        self._waiting: queue.Queue[str | None] = queue.Queue(_LINES)
        self._left_out = 0
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()

    def say(self, name: str, text: str) -> None:
        """Print a line of the process ``name``; never waits."""
        try:
            self._waiting.put_nowait(f"{self._labels[name]}{text}\n")
        except queue.Full:
            self._left_out += 1

    def close(self, within_s: float) -> None:
        """Print what waits, unless it takes too long."""
        try:
            self._waiting.put(None, timeout=within_s)
        except queue.Full:
            return
        self._writer.join(within_s)

    def _write(self) -> None:
        try:
            while (line := self._next()) is not None:
                if self._left_out and self._waiting.empty():
                    left_out, self._left_out = self._left_out, 0
                    line += f"({left_out} lines are left out here: the terminal took none)\n"
                data = line.encode()
                while data:
                    data = data[os.write(_STDOUT, data) :]
        except OSError:  # EPIPE of a pipe, EIO of a terminal: there is nobody to tell
            self._gone()

    def _next(self) -> str | None:
        """The next line, or None at the end. Raises OSError if nobody reads, even while there is nothing to print."""
        while True:
            try:
                return self._waiting.get(timeout=_LOOK_EVERY_S)
            except queue.Empty:
                watch = select.poll()
                watch.register(_STDOUT, 0)
                if watch.poll(0):
                    raise BrokenPipeError from None
