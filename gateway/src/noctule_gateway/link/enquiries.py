"""What the gateway itself asks a unit, and when; times are those that go into the link.

HELLO now and again, because a reset may show in nothing else, and when nothing at all has come for a while, because
another unit may be there. After a HELLO that finds another boot, CLOCK exchanges in a row, until the unit's time can be
told; SETTINGS once, and MECHANICS; STATUS and CLOCK in turn from then on, and MECHANICS when STATUS says that it has
changed.
"""

from math import inf

from noctule_gateway.wire.frames import AskClock, AskHello, AskMechanics, AskSettings, AskStatus, Enquiry, Status

QUICK_CLOCKS = 8
CLOCK_EVERY_S = 0.97  # not in step with STATUS, nor with what a unit does once a second
STATUS_EVERY_S = 1.0
HELLO_EVERY_S = 10.0
HELLO_RETRY_S = 0.75  # longer than its time-out, so that over a bad line other enquiries have their turns, too
SETTINGS_RETRY_S = MECHANICS_RETRY_S = 2.0


class Enquiries:
    """When each enquiry is due; which of them may be asked is the link's state."""

    def __init__(self) -> None:
        self._clocks_to_begin_with = QUICK_CLOCKS
        self._hello_asked_s = -inf
        self._hello_due_s = self._clock_due_s = self._status_due_s = self._settings_due_s = 0.0
        self._mechanics_due_s = inf
        self._mechanics_number: int | None = None  # in 4 bits: one that was never heard tells nothing

    @property
    def hello_due_s(self) -> float:
        """When HELLO is due."""
        return self._hello_due_s

    @property
    def due_s(self) -> float:
        """When the next enquiry of any kind is due."""
        return min(
            self._hello_due_s, self._clock_due_s, self._status_due_s, self._settings_due_s, self._mechanics_due_s
        )

    @property
    def time_is_known(self) -> bool:
        """There have been enough CLOCK exchanges with this boot to tell when its sweeps were made."""
        return self._clocks_to_begin_with == 0

    def urgent(self, now_s: float) -> Enquiry | None:
        """What goes before any order, if something does: who is there, and its time."""
        if now_s >= self._hello_due_s:
            self._hello_asked_s, self._hello_due_s = now_s, now_s + HELLO_RETRY_S
            return AskHello(0)
        return None if self.time_is_known else AskClock(0)

    def routine(self, now_s: float) -> Enquiry:
        """What is asked when there is nothing else to say."""
        if now_s >= self._settings_due_s:
            self._settings_due_s = now_s + SETTINGS_RETRY_S
            return AskSettings(0)
        if now_s >= self._mechanics_due_s:
            self._mechanics_due_s = now_s + MECHANICS_RETRY_S
            return AskMechanics(0)
        if now_s >= self._status_due_s:
            self._status_due_s = now_s + STATUS_EVERY_S
            return AskStatus(0)
        self._clock_due_s = now_s + CLOCK_EVERY_S
        return AskClock(0)

    def greet(self, at_s: float) -> None:
        """It is not known who is there, or there is doubt: HELLO at ``at_s``."""
        self._hello_due_s = at_s

    def greet_soon(self, now_s: float) -> None:
        """Something waits for an answer to HELLO: over a bad line, other enquiries have their turns between two."""
        self.greet(min(self._hello_due_s, max(now_s, self._hello_asked_s + HELLO_RETRY_S)))

    def greeted(self, now_s: float) -> None:
        """HELLO has been answered."""
        self._hello_due_s = now_s + HELLO_EVERY_S

    def begin(self, now_s: float, rebooted: bool, knows_mechanics: bool) -> None:
        """The unit has been identified, under another boot than last time if ``rebooted``."""
        self._clock_due_s = self._status_due_s = self._settings_due_s = now_s
        if rebooted:
            self._mechanics_due_s, self._mechanics_number = inf, None if knows_mechanics else 0
        # One at least: only its ticks show a unit that lost its power and forgot how often it has booted.
        self._clocks_to_begin_with = QUICK_CLOCKS if rebooted else max(self._clocks_to_begin_with, 1)

    def clock_came(self) -> None:
        """A CLOCK exchange has succeeded."""
        self._clocks_to_begin_with = max(0, self._clocks_to_begin_with - 1)

    def status_came(self, status: Status, now_s: float) -> None:
        """STATUS has come, asked for or not."""
        if status.mechanics_number != self._mechanics_number:
            self._mechanics_number, self._mechanics_due_s = status.mechanics_number, now_s

    def mechanics_came(self) -> None:
        """MECHANICS has been answered."""
        self._mechanics_due_s = inf

    def settings_came(self) -> None:
        """SETTINGS has been answered."""
        self._settings_due_s = inf

    def settings_changed(self, now_s: float) -> None:
        """An order has changed the unit's settings: read them again."""
        self._settings_due_s = now_s
