"""Whether the relay still answers: a frozen one keeps its process and its ports."""

from collections.abc import Callable
from contextlib import closing
from http.client import HTTPConnection, HTTPException
from time import monotonic

_LOOK_EVERY_S = 10.0
_ANSWER_WITHIN_S = 2.0
_DEAD_AFTER = 3  # looks in a row


class Pulse:
    """Asks the relay's web server at ``host`` and ``port`` for its page's head, every ten seconds.

    ``now`` counts seconds evenly.
    """

    def __init__(self, host: str, port: int, now: Callable[[], float] = monotonic) -> None:
        self._host, self._port, self._now = host, port, now
        self.looks = self.failed = 0
        self._failed_in_a_row = 0
        self._answered_s = now()  # it listens
        self._due_s = self._answered_s + _LOOK_EVERY_S

    def feel(self) -> None:
        """Ask, if it is time to. Takes two seconds at the most."""
        asked_s = self._now()
        if asked_s < self._due_s:
            return
        self._due_s = asked_s + _LOOK_EVERY_S
        self.looks += 1
        if self._answers():
            self._failed_in_a_row = 0
            self._answered_s = asked_s
        else:
            self.failed += 1
            self._failed_in_a_row += 1

    @property
    def beats(self) -> bool:
        """The relay has answered one of the last three times."""
        return self._failed_in_a_row < _DEAD_AFTER

    @property
    def silent_s(self) -> float:
        """Since the relay has last answered, where it has not for three times; else 0. From any thread."""
        return 0.0 if self.beats else self._now() - self._answered_s

    def _answers(self) -> bool:
        with closing(HTTPConnection(self._host, self._port, timeout=_ANSWER_WITHIN_S)) as relay:
            try:
                relay.request("GET", "/favicon.ico")
                relay.getresponse()
            except (OSError, HTTPException):
                return False
        return True
