"""A failing history made small: parts of it are left out as long as it still fails."""

from collections.abc import Callable

from system.histories.faults import History


def shrink(history: History, fails: Callable[[History], bool]) -> History:
    """The smallest part of ``history`` found that still fails: from it no single fault can be left out.

    Delta debugging (Zeller and Hildebrandt 2002, "Simplifying and isolating failure-inducing input"): halves are left
    out first, then quarters, down to single faults. A failure that needs luck may be lost, so try it again.
    """
    size = max(len(history) // 2, 1)
    while True:
        smaller = next(
            (
                shorter
                for first in range(0, len(history), size)
                if fails(shorter := [*history[:first], *history[first + size :]])
            ),
            None,
        )
        if smaller is not None:
            history, size = smaller, max(min(size, len(smaller) // 2), 1)
        elif size == 1:
            return history
        else:
            size //= 2
