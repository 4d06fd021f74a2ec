"""Who is at the other end of the line: the unit expected or another, there or gone, the same boot or a later one."""

from noctule_gateway.clock.regression import TICKS_TO_WRAP
from noctule_gateway.errors import WrongUnitError
from noctule_gateway.wire.frames import NO_SERIAL, PROTOCOL, PROTOCOLS, Hello, Loader, Sweep

SILENT_AFTER = 6  # time-outs in a row, and nothing between them
GARBLED_AFTER = 60  # time-outs in a row, and between them nothing that can be read

_SLACK_TICKS = 400_000  # frames may pass one another within the unit, but not by 0.1 s


def mismatch(hello: Hello | Loader, serial: int) -> WrongUnitError | None:
    """What is wrong with who says ``hello`` where unit ``serial`` is expected; None if nothing is."""
    if hello.protocol not in PROTOCOLS:
        return WrongUnitError(f"the unit speaks protocol {hello.protocol}, the gateway {PROTOCOL}: update one of them")
    return another_unit(hello, serial)


def another_unit(frame: Hello | Loader | Sweep, serial: int) -> WrongUnitError | None:
    """What is wrong with who names itself in ``frame`` where unit ``serial`` is expected; None if nothing is."""
    if frame.serial == serial:
        return None
    found = "a unit without a serial number" if frame.serial == NO_SERIAL else f"unit {frame.serial}"
    return WrongUnitError(f"{found} answers where the site file has {serial}: check cable and address")


class Silence:
    """Time-outs since something came, and since something that could be read came."""

    def __init__(self) -> None:
        self._nothing_came = self._nothing_read = 0

    def timed_out(self) -> None:
        """An answer has not come."""
        self._nothing_came += 1
        self._nothing_read += 1

    def garbled(self) -> None:
        """Something has come that can't be read."""
        self._nothing_came = 0

    def broken(self) -> None:
        """Something has come that can be read, or all begins again."""
        self._nothing_came = self._nothing_read = 0

    @property
    def may_be_a_pulled_plug(self) -> bool:
        """Nothing at all has come for a whole enquiry: over a bad line something mostly does."""
        return self._nothing_came > 1

    @property
    def lasts(self) -> bool:
        """The unit is gone, or nothing it sends can be read."""
        return self._nothing_came >= SILENT_AFTER or self._nothing_read >= GARBLED_AFTER


class BootWatch:
    """The boot that the unit last named in a HELLO, and what has spoken against it since.

    A boot is a ``boot_of_life``: its number, and the unit's life above it.
    """

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
        back_ticks = self._last_tick - tick
        if _SLACK_TICKS < back_ticks < TICKS_TO_WRAP // 2:  # by more than half a turn: the counter has begun again
            self._ticks_went_back = True
        self._last_tick = tick
        return self._ticks_went_back

    def doubted_by_sweep(self, boot: int) -> bool:
        """A sweep of ``boot`` is the first of a later boot, as far as 16 bits can tell, or of another life.

        Each boot is doubted once.
        """
        if self._boot is None:
            return False
        later = 0 < (boot - self._boot) % 0x10000 < 0x8000 or boot >> 16 != self._boot >> 16
        if not later or boot in self._doubted:
            return False
        self._doubted.add(boot)
        return True
