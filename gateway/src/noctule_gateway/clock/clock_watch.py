"""The host's wall clock: how far it is ahead of the clock that nobody sets, and whether somebody has set it.

Sweeps carry its time. So the status says when it was set, and times told before and after that are marked: they
are of different epochs. Both of the kernel's clocks are slewed alike, so only a set changes their difference.
"""

import json
import logging
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

from noctule import elapsed
from noctule.elapsed import Instant

SHOWN_S = 600.0
_SET_S = 0.1
_AT_ONCE_S = 1e-4  # the clocks are read one after the other; half of what comes between is an error of the offset
_TRIES = 10

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class WallClock:
    """``utc_offset_s``: UTC less the monotonic clock. Only times told under one ``epoch`` can be compared."""

    utc_offset_s: float
    epoch: str


@dataclass(frozen=True)
class _Epoch:
    """Since when the wall clock has not been set: it has been ``offset_s`` ahead of the time since ``kernel_boot``."""

    epoch: str
    kernel_boot: str
    offset_s: float


class ClockWatch:
    """Compares the wall clock with the time since the kernel's boot, at each look. Safe to use from several threads.

    The file ``kept`` carries the epoch over a restart. Only keep() writes it: a disk that hangs must hold up no unit.
    ``sets`` counts how often the clock was set, ``detail`` says so for SHOWN_S and is empty otherwise.
    """

    def __init__(self, kept: Path, now: Callable[[], Instant] = elapsed.now) -> None:
        self.sets = 0
        self.detail = ""
        self._kept, self._now = kept, now
        self._lock = threading.Lock()
        self._last = _read(kept)
        self._kept_epoch = self._warned_epoch = self._last.epoch
        self._shown_until_s = 0.0

    def look(self) -> WallClock:
        """What the wall clock shows now, and under which epoch."""
        with self._lock:
            now, monotonic_s, gap_s = self._read_clocks()
            self._note(now, gap_s)
            return WallClock(now.utc_s - monotonic_s, self._last.epoch)

    def keep(self) -> None:
        """Look, and write down a new epoch; to be called each second, by one thread."""
        self.look()
        last = self._last
        if last.epoch == self._kept_epoch:
            return
        part = self._kept.with_name(f"{self._kept.name}.part")
        try:
            part.write_text(json.dumps(asdict(last)))
            part.replace(self._kept)
            self._kept_epoch = last.epoch
        except OSError as error:
            if self._warned_epoch != last.epoch:
                _log.warning("%s can't be written (%s): until it can, a restart begins a clock epoch", part, error)
            self._warned_epoch = last.epoch

    def _read_clocks(self) -> tuple[Instant, float, float]:
        """The clocks as of one moment: a look that another process has broken in upon is repeated."""
        readings: list[tuple[float, float, Instant]] = []
        for _ in range(_TRIES):
            before_s = time.monotonic()
            now = self._now()
            after_s = time.monotonic()
            readings.append((after_s - before_s, (before_s + after_s) / 2, now))
            if readings[-1][0] <= _AT_ONCE_S:
                break
        gap_s, monotonic_s, now = min(readings, key=lambda reading: reading[0])
        return now, monotonic_s, gap_s

    def _note(self, now: Instant, gap_s: float) -> None:
        last, offset_s = self._last, now.utc_s - now.since_boot_s
        rebooted = now.kernel_boot != last.kernel_boot
        was_set = not rebooted and abs(offset_s - last.offset_s) > _SET_S + gap_s
        if was_set:
            self._tell_set(offset_s - last.offset_s, now)
        epoch = secrets.token_hex(8) if rebooted or was_set else last.epoch
        self._last = _Epoch(epoch, now.kernel_boot, offset_s)
        if now.since_boot_s > self._shown_until_s:
            self.detail = ""

    def _tell_set(self, forward_s: float, now: Instant) -> None:
        self.sets += 1
        way, by_s = ("forward" if forward_s > 0 else "back"), f"{abs(forward_s):.{0 if abs(forward_s) >= 10 else 1}f}"
        self.detail = f"the host's clock was set {way} by {by_s} s: sweeps logged before have times of the old clock"
        self._shown_until_s = now.since_boot_s + SHOWN_S
        _log.warning("%s", self.detail)


def _read(kept: Path) -> _Epoch:
    """The epoch that a gateway kept; one of no boot where none was kept, or it can't be read."""
    try:
        found = _Epoch(**json.loads(kept.read_text()))
        if found.epoch and isinstance(found.epoch, str) and isinstance(found.offset_s, float):
            return found
    except (OSError, ValueError, TypeError, RecursionError):
        pass  # the next look begins an epoch, which is what must follow
    return _Epoch("", "", 0.0)
