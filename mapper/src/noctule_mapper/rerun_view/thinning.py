"""Figures that come each second, thinned: a plot needs fewer, and each costs the relay two kilobytes."""

from collections.abc import Callable, Mapping
from time import monotonic

FIGURES_EVERY_S = 10.0


class Thinning:
    """Lets a figure through at most every FIGURES_EVERY_S, and of a set of counters those that have changed."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._shown_s: dict[str, float] = {}
        self._values: dict[str, float] = {}

    def is_due(self, figure: str) -> bool:
        """True if ``figure`` is to be shown now; it then is not for a while."""
        now_s = self._now()
        if now_s - self._shown_s.get(figure, -FIGURES_EVERY_S) < FIGURES_EVERY_S:
            return False
        self._shown_s[figure] = now_s
        return True

    def changed(self, values: Mapping[str, float]) -> dict[str, float]:
        """Those that are not as they were when this was last asked."""
        found = {name: value for name, value in values.items() if self._values.get(name) != value}
        self._values.update(found)
        return found
