"""Sweeps that can't be mapped: counted by unit, logged once for each unit and kind, in the status while they last."""

import logging
import threading
from dataclasses import dataclass

from noctule_mapper.live.troubles import ShowEvent
from noctule_mapper.readings.sweep import SweepError

_log = logging.getLogger(__name__)

_GOOD_SWEEPS = 10  # in a row, after which a unit is well again: one that fails now and then is not
_MOST_UNITS = 5  # that a status names


@dataclass
class _Unit:
    refused: int = 0
    good: int = 0  # since
    last: str = ""


class RefusedSweeps:
    """What became of the units' sweeps. Safe to use from several threads."""

    def __init__(self, show_event: ShowEvent) -> None:
        self._show_event = show_event
        self._lock = threading.Lock()
        self._units: dict[str, _Unit] = {}
        self._told: set[tuple[str, str]] = set()
        self._count = 0

    def refuse(self, unit: str, error: SweepError) -> None:
        """A sweep of ``unit`` is left out for ``error``."""
        with self._lock:
            self._count += 1
            state = self._units.setdefault(unit, _Unit())
            state.refused, state.good, state.last = state.refused + 1, 0, str(error)
            new = (unit, error.kind) not in self._told
            self._told.add((unit, error.kind))
        if new:
            _log.warning("%s; it is left out, and so are others of its kind", error)
            self._show_event(str(error), "WARN")

    def accept(self, unit: str) -> None:
        """A sweep of ``unit`` is mapped."""
        with self._lock:
            state = self._units.get(unit)
            if state is not None:
                state.good += 1
                if state.good >= _GOOD_SWEEPS:
                    del self._units[unit]

    def count(self) -> int:
        """All sweeps that were read and refused."""
        with self._lock:
            return self._count

    def detail(self) -> str:
        """The units whose sweeps are refused, how many of them and why the last one; empty while there are none."""
        with self._lock:
            lines = [
                f"{one.refused} sweep{'' if one.refused == 1 else 's'} of {unit} left out, the last: {one.last}"
                for unit, one in sorted(self._units.items())
            ]
        more = [f"and sweeps of {len(lines) - _MOST_UNITS} more units"] if len(lines) > _MOST_UNITS else []
        return "; ".join([*lines[:_MOST_UNITS], *more])
