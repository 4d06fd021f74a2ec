"""Which of a unit's sweeps are on their way to the log and which are in it, so that a resend is known."""

from collections import deque
from enum import Enum, auto

from noctule_gateway.frames import Sweep

_REMEMBERED = 64  # a unit has one sweep on the line at a time


class Standing(Enum):
    """How far a sweep has got."""

    NEW = auto()
    WAITING = auto()
    COMMITTED = auto()


class Receipts:
    """The standing of the latest sweeps. ``duplicates`` counts those that came again."""

    def __init__(self) -> None:
        self.duplicates = 0
        self._waiting: set[Sweep] = set()
        self._committed: deque[Sweep] = deque(maxlen=_REMEMBERED)

    def arrive(self, sweep: Sweep) -> Standing:
        """The standing of a sweep that has come; a new one waits from now on."""
        if sweep in self._committed:
            self.duplicates += 1
            return Standing.COMMITTED
        if sweep in self._waiting:
            self.duplicates += 1
            return Standing.WAITING
        self._waiting.add(sweep)
        return Standing.NEW

    def committed(self, sweep: Sweep) -> None:
        """``sweep`` is safe."""
        self._waiting.discard(sweep)
        self._committed.append(sweep)

    def failed(self, sweep: Sweep) -> None:
        """``sweep`` could not be committed: it is new when it comes again."""
        self._waiting.discard(sweep)
