"""What is wrong with the mapper: logged and shown once as it begins, in the status for as long as it lasts."""

import logging
import threading
from typing import Protocol

_log = logging.getLogger(__name__)


class ShowEvent(Protocol):
    """Shows a line in the log of events; ``level`` as INFO, WARN or ERROR."""

    def __call__(self, text: str, level: str = "INFO") -> None: ...


class Troubles:
    """Troubles by kind, one of each kind at a time. Safe to use from several threads."""

    def __init__(self, show_event: ShowEvent) -> None:
        self._show_event = show_event
        self._lock = threading.Lock()
        self._texts: dict[str, str] = {}

    def begin(self, kind: str, text: str, error: BaseException | None = None) -> None:
        """There is trouble of this kind; it is news only where there was none with this text. ``error`` is what showed
        it, for the log.
        """
        with self._lock:
            known = self._texts.get(kind) == text
            self._texts[kind] = text
        if not known:
            _log.warning("%s", text, exc_info=error)
            self._show_event(text, "WARN")

    def end(self, kind: str, text: str) -> None:
        """The trouble of this kind, if there was any, is over, which ``text`` says."""
        with self._lock:
            known = self._texts.pop(kind, None)
        if known is not None:
            _log.info("%s", text)
            self._show_event(text)

    def detail(self) -> str:
        """All there are, as a status tells them; empty while all is well."""
        with self._lock:
            return "; ".join(self._texts.values())
