"""What a relay should always have: the last drawing of each subject, drawn again before the relay forgets it.

A relay forgets its oldest drawings once it holds as much as it may. What stands, such as a contour that nothing has
changed for days, would be among them.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from time import monotonic

from noctule_mapper.rerun_view.drawing import Drawing

REDRAWN_AFTER_S = 300.0  # others draw on the relay too, and how much is not known here
REDRAWN_AFTER_BYTES = 2_000_000  # of new drawings
_REDRAWN_AFTER_TIMES = 4  # as many bytes as stand: a large map is not drawn again for every few sweeps


@dataclass
class _Subject:
    drawing: Drawing  # the last one that was put
    drawn: Drawing | None = None  # the last one that was drawn
    content_bytes: int = 0  # of that one
    drawn_s: float = 0.0
    drawn_at_bytes: int = 0  # of new drawings
    missed: bool = False


class Standing:
    """The subjects, the one that was drawn longest ago first. For several threads, under a lock of theirs."""

    def __init__(self, now: Callable[[], float] = monotonic) -> None:
        self._now = now
        self._subjects: dict[str, _Subject] = {}
        self._new_bytes = self._standing_bytes = 0

    def put(self, drawing: Drawing) -> None:
        """``drawing`` waits to be drawn, and replaces the last one of its subject, if it has one."""
        if drawing.subject is None:
            return
        subject = self._subjects.setdefault(drawing.subject, _Subject(drawing))
        subject.drawing, subject.missed = drawing, False

    def drop(self, drawing: Drawing) -> None:
        """``drawing`` will not be drawn in its turn."""
        if drawing.subject is not None and self._subjects[drawing.subject].drawing is drawing:
            self._subjects[drawing.subject].missed = True

    def begin(self, waiting: Collection[Drawing]) -> None:
        """A relay that has nothing yet: all subjects were missed, except those whose drawings are ``waiting``."""
        will_come = {id(drawing) for drawing in waiting}
        for subject in self._subjects.values():
            subject.missed = id(subject.drawing) not in will_come

    def drawn(self, drawing: Drawing, content_bytes: int) -> None:
        """``drawing`` took so many bytes, of which a relay has its own idea."""
        subject = self._subjects.pop(drawing.subject, None) if drawing.subject is not None else None
        if subject is None or drawing.subject is None:
            self._new_bytes += content_bytes
            return
        self._new_bytes += content_bytes if subject.drawn is not drawing else 0
        self._standing_bytes += content_bytes - subject.content_bytes
        subject.drawn, subject.content_bytes = drawing, content_bytes
        subject.drawn_s, subject.drawn_at_bytes = self._now(), self._new_bytes
        subject.missed = subject.missed and subject.drawing is not drawing
        self._subjects[drawing.subject] = subject  # the last of them now

    def missed(self) -> Drawing | None:
        """One that the relay has not had."""
        return next((subject.drawing for subject in self._subjects.values() if subject.missed), None)

    def due(self) -> Drawing | None:
        """The one that was drawn longest ago, if the relay may forget it soon."""
        oldest = next((subject for subject in self._subjects.values() if subject.drawn is not None), None)
        if oldest is None:
            return None
        after_bytes = max(REDRAWN_AFTER_BYTES, _REDRAWN_AFTER_TIMES * self._standing_bytes)
        forgotten = self._new_bytes - oldest.drawn_at_bytes >= after_bytes
        return oldest.drawing if forgotten or self._now() - oldest.drawn_s >= REDRAWN_AFTER_S else None
