"""Which of a unit's sweeps are on their way to the log and which are in it, so that a resend is known."""

from collections import deque
from enum import Enum, auto

from noctule_gateway.wire.frames import AnySweep

ACKNOWLEDGE_AGAIN_S = 0.25  # at most so often for what could not be read
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
        self._waiting: set[AnySweep] = set()
        self._acknowledged: AnySweep | None = None
        self._again_s = 0.0
        self._committed: deque[AnySweep] = deque(maxlen=_REMEMBERED)

    def arrive(self, sweep: AnySweep) -> Standing:
        """The standing of a sweep that has come; a new one waits from now on."""
        if sweep in self._committed:
            self.duplicates += 1
            return Standing.COMMITTED
        if sweep in self._waiting:
            self.duplicates += 1
            return Standing.WAITING
        self._waiting.add(sweep)
        return Standing.NEW

    def committed(self, sweep: AnySweep) -> None:
        """``sweep`` is safe."""
        self._waiting.discard(sweep)
        self._committed.append(sweep)

    def failed(self, sweep: AnySweep) -> None:
        """``sweep`` could not be committed: it is new when it comes again."""
        self._waiting.discard(sweep)

    def acknowledged(self, sweep: AnySweep) -> None:
        """The acknowledgement of ``sweep`` is on its way; it may get lost."""
        self._acknowledged = sweep

    def to_acknowledge_again(self, now_s: float) -> AnySweep | None:
        """The sweep that something unreadable may have been, because the unit has not heard that it is safe."""
        if now_s < self._again_s:
            return None
        self._again_s = now_s + ACKNOWLEDGE_AGAIN_S
        return self._acknowledged
