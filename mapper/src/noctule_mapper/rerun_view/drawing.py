"""One thing to show: what is drawn, at which time, and of which subject."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import rerun as rr

Entries = Iterable[tuple[str, rr.AsComponents]]
"""Entity paths and what to log there."""


@dataclass(frozen=True)
class Drawing:
    """Something to show. ``draw(*arguments)`` makes its entries, on the link's worker.

    ``subject`` names what it shows: the last drawing of each subject is drawn again when the relay may have missed or
    forgotten it. An event has none, and neither has a figure that comes again in any case.
    """

    draw: Callable[..., Entries]
    arguments: tuple[Any, ...]
    time_s: float
    sweep: int
    subject: str | None = None
