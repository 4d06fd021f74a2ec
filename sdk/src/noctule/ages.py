"""How long ago, as people say it."""

_NOW_S, _MINUTE_S, _HOUR_S, _DAY_S = 5.0, 60.0, 3_600.0, 86_400.0


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
