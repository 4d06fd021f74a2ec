"""Whether it is still the same boot of a unit that answers: by its HELLO, by its ticks, by the boots of its sweeps."""

_SLACK_TICKS = 400_000  # frames may pass one another within the unit, but not by 0.1 s


class BootWatch:
    """The boot that the unit last named in a HELLO, and what has spoken against it since."""

    def __init__(self) -> None:
        self._boot: int | None = None
        self._last_tick = 0
        self._ticks_went_back = False
        self._doubted: set[int] = set()

    def is_another(self, boot: int) -> bool:
        """A HELLO that names ``boot`` is of another boot, maybe under the same number."""
        return boot != self._boot or self._ticks_went_back

    def begin(self, boot: int) -> None:
        """The unit runs under ``boot``, from its first tick on."""
        self._boot = boot
        self._last_tick, self._ticks_went_back = 0, False

    def refuted_by_tick(self, tick: int) -> bool:
        """``tick``, or one before it, is of another boot."""
        if tick + _SLACK_TICKS < self._last_tick:
            self._ticks_went_back = True
        self._last_tick = tick
        return self._ticks_went_back

    def doubted_by_sweep(self, boot: int) -> bool:
        """A sweep of ``boot`` is the first of a later boot, as far as 16 bits can tell. Each boot is doubted once."""
        later = self._boot is not None and 0 < (boot - self._boot) % 0x10000 < 0x8000
        if not later or boot in self._doubted:
            return False
        self._doubted.add(boot)
        return True
