"""How far a long command has got: a line on the terminal that people watch, nothing where there is none.

It appears after a second, so that nobody waits for rich to load who would not have waited for the work.
"""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

_AFTER_S = 1.0


class Progress:
    """What is being done, and how much of it is done."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._present: tuple[str, int, int | None] = ("", 0, None)
        self._bar: Bar | None = None

    def at(self, what: str, done: int = 0, total: int | None = None) -> None:
        """``what`` is under way: ``done`` of ``total``, or of nobody knows how many."""
        with self._lock:
            self._present = what, done, total
            if self._bar is not None:
                self._put(self._bar)

    def _show(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, SpinnerColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bar

        words = [TextColumn(f"{{task.{field}}}", markup=False) for field in ("description", "fields[count]")]
        columns = (SpinnerColumn(), words[0], BarColumn(), words[1], TimeElapsedColumn())
        bar = Bar(*columns, console=Console(stderr=True), transient=True)
        bar.add_task("", count="")
        with self._lock:
            self._put(bar)
            self._bar = bar
            bar.start()

    def _put(self, bar: "Bar") -> None:
        what, done, total = self._present
        count = f"{done}/{total}" if total is not None else str(done or "")
        (task,) = bar.task_ids
        bar.update(task, description=what, completed=done, total=total, count=count)

    def _hide(self) -> None:
        with self._lock:
            if self._bar is not None:
                self._bar.stop()


@contextmanager
def progress() -> Iterator[Progress]:
    """A line that is on the terminal until the end; standard output is free for what the command prints after that."""
    shown = Progress()
    if not sys.stderr.isatty():
        yield shown
        return
    timer = threading.Timer(_AFTER_S, shown._show)
    timer.daemon = True
    timer.start()
    try:
        yield shown
    finally:
        timer.cancel()
        timer.join()
        shown._hide()
