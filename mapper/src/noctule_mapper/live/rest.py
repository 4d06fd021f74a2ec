"""How long what has failed rests before it is started again."""

_FIRST_S, _LONGEST_S = 1.0, 60.0
_STEADY_AFTER_S = 60.0


class Rest:
    """1 s, then twice as long with each failure, 60 s at most; 1 s again after it has worked for a minute."""

    def __init__(self) -> None:
        self._next_s = _FIRST_S

    def after(self, worked_s: float) -> float:
        """The rest after a failure of what had worked for ``worked_s``."""
        if worked_s >= _STEADY_AFTER_S:
            self.forget()
        rest_s = self._next_s
        self._next_s = min(2 * rest_s, _LONGEST_S)
        return rest_s

    def forget(self) -> None:
        """The next failure is the first."""
        self._next_s = _FIRST_S
