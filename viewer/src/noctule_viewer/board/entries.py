"""What is drawn: entity paths and what to log there."""

from collections.abc import Iterable

import rerun as rr

Entries = Iterable[tuple[str, rr.AsComponents]]
