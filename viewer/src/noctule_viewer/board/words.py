"""Hours and lists as people say them."""

from collections.abc import Sequence
from datetime import UTC, datetime

_LISTED = 5


def hour(time_s: float, now_s: float) -> str:
    """A time in UTC, as the page's own time line and events have it: the hour, with the date if it was another day."""
    time, now = datetime.fromtimestamp(time_s, UTC), datetime.fromtimestamp(now_s, UTC)
    return time.strftime("%H:%M:%S" if time.date() == now.date() else "%d %b %H:%M")


def listed(words: Sequence[str]) -> str:
    """The first few, and how many more there are."""
    more = len(words) - _LISTED
    return ", ".join(words[:_LISTED]) + (f" and {more} more" if more > 0 else "")


def counted(count: int, noun: str) -> str:
    """``1 wall``, ``2 walls``."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
