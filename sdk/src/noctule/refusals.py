"""Messages that were refused: all are counted, and the log names each key once, whatever floods the bus."""

import logging
import threading

_KEYS_TOLD = 1000  # so that made-up keys fill neither memory nor log
_SHOWN = 200  # characters of a key

_log = logging.getLogger(__name__)


class Refusals:
    """The refusals of one client. From any thread."""

    def __init__(self) -> None:
        self.count = 0
        self._told: set[str] = set()
        self._lock = threading.Lock()

    def note(self, key: str, reason: object) -> None:
        """A message on ``key`` was refused."""
        key = key[:_SHOWN]
        with self._lock:
            self.count += 1
            if key in self._told or len(self._told) > _KEYS_TOLD:
                return
            self._told.add(key)
            last = len(self._told) > _KEYS_TOLD
        if last:
            _log.warning("messages on more than %d keys were refused; further keys are not named", _KEYS_TOLD)
        else:
            _log.warning("%s: message refused, and later ones on this key without a word: %s", key, reason)
