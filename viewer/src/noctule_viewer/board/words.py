"""Ages and lists as people say them."""

from collections.abc import Sequence
from datetime import UTC, datetime

_NOW_S, _MINUTE_S, _HOUR_S, _DAY_S = 5.0, 60.0, 3_600.0, 86_400.0
_LISTED = 5


def age(seconds: float) -> str:
    """``just now``, ``40 s ago``, ``12 min ago``, ``3 h ago``, ``5 days ago``."""
    if seconds < _NOW_S:
        return "just now"
    return f"{duration(seconds)} ago"


def duration(seconds: float) -> str:
    """``40 s``, ``12 min``, ``3 h``, ``5 days``: whole units, rounded down."""
    if seconds < _MINUTE_S:
        return f"{int(seconds)} s"
    if seconds < _HOUR_S:
        return f"{int(seconds // _MINUTE_S)} min"
    if seconds < 2 * _DAY_S:
        return f"{int(seconds // _HOUR_S)} h"
    return f"{int(seconds // _DAY_S)} days"


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
