"""The clocks of a unit's boots: its ring outlives a reset, so sweeps of earlier boots may still come."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf

from noctule_gateway.clock.regression import (
    GOOD_DRIFT_ERROR,
    MOST_DRIFT,
    TICK_S,
    TICKS_TO_WRAP,
    Exchange,
    HostTime,
    NominalClock,
    RegressedClock,
    UnitClock,
)

UNKNOWN_BOOT_ERROR_S = 3600.0  # nothing tells how long a sweep has waited; a ring of them is rarely older than this
_KEPT_BOOTS = 8
_AHEAD_S = 3.0  # until the next look at a unit's clock has had its effect

Anchor = tuple[int, HostTime]


@dataclass(frozen=True)
class TickLine:
    """A unit's ticks as UTC from ``tick`` on; ``error_s`` is what they may be off by within the next seconds.

    That is one standard deviation or, where this is less, what the latest exchange bounds it to: a clock whose best
    exchange was long ago states a large one, and may still be right.
    """

    tick: int
    utc_s: float
    tick_s: float
    error_s: float


@dataclass(frozen=True)
class SweepTime:
    """A sweep's ``start`` in UTC, with an error that covers its readings too, and how fast its unit counted meanwhile.

    ``drift`` is by how much the oscillator is fast, None where that is not known well enough to correct ranges by it;
    ``pace`` is the best estimate of the unit's seconds in a true one.
    """

    start: HostTime
    drift: float | None
    pace: float


class BootClocks:
    """Tells when a tick of any boot was, in UTC.

    The clocks run on the host's monotonic time, and ``utc_offset_s`` (UTC less monotonic) is added only when a time is
    told, so that a host whose UTC is set right does not confuse them. ``anchor`` finds a boot's newest sweep in the
    log: its start tick and time in UTC, or None.
    """

    def __init__(self, nominal: bool, anchor: Callable[[int], Anchor | None]) -> None:
        self._make: type[NominalClock] | type[RegressedClock] = NominalClock if nominal else RegressedClock
        self._anchor = anchor
        self._clocks: OrderedDict[int, UnitClock] = OrderedDict()
        self._boot = 0
        self._begun_s = 0.0
        self._bound_s = inf  # of the latest exchange: by so much the clock can be off at most
        self._last_ticks: dict[int, int] = {}  # of each boot, the last that is known, counted on over wraps

    def begin(self, boot: int, now_s: float, utc_offset_s: float) -> None:
        """The unit has shown at ``now_s``, in the host's monotonic time, that it runs under ``boot``."""
        self._boot = boot
        self._begun_s = now_s
        self._bound_s = inf
        self._clock_of(boot, utc_offset_s)

    def add(self, exchange: Exchange) -> bool:
        """Take in an exchange of the present boot; False if it was refused."""
        received_tick = self._unwrapped(self._boot, exchange.received_tick)
        sent_tick = self._unwrapped(self._boot, exchange.sent_tick)
        self._last_ticks[self._boot] = sent_tick
        clock = self._clocks[self._boot]
        taken = clock.add(replace(exchange, received_tick=received_tick, sent_tick=sent_tick))
        told = clock.at((received_tick + sent_tick) // 2)
        off_s = abs(told.time_s - exchange.host_s) if taken and told is not None else inf
        self._bound_s = off_s + max(0.0, exchange.half_trip_s)
        return taken

    def at(self, boot: int, tick: int, utc_offset_s: float) -> HostTime:
        """When ``tick`` of ``boot`` was, in UTC. Of a boot that nothing is known of: before the present one began."""
        known = self._clock_of(boot, utc_offset_s).at(self._unwrapped(boot, tick))
        if known is not None:
            return HostTime(known.time_s + utc_offset_s, known.error_s)
        began = self._clocks[self._boot].at(0)
        began_s = began.time_s if began is not None else self._begun_s
        return HostTime(began_s + utc_offset_s, UNKNOWN_BOOT_ERROR_S)

    def sweep_time(self, boot: int, ticks: tuple[int, int], utc_offset_s: float) -> SweepTime:
        """When the sweep of ``boot`` was, whose first and last reading were made at ``ticks``."""
        began, ended = (self.at(boot, tick, utc_offset_s) for tick in ticks)
        drift = self.good_drift(boot)
        # Before the drift is known that well, its estimate is good enough to count the seconds of a sweep.
        counted = self._clocks[boot].drift if drift is None else drift
        pace = 1.0 + counted if abs(counted) <= MOST_DRIFT else 1.0
        return SweepTime(HostTime(began.time_s, max(began.error_s, ended.error_s)), drift, pace)

    def line(self, utc_offset_s: float) -> TickLine | None:
        """The present boot's ticks from its last exchange on; None before the first."""
        tick = self._last_ticks.get(self._boot)
        clock = self._clocks.get(self._boot)
        if tick is None or clock is None:
            return None
        here, ahead = clock.at(tick), clock.at(tick + round(_AHEAD_S / TICK_S))
        if here is None or ahead is None:
            return None
        tick_s = (ahead.time_s - here.time_s) / _AHEAD_S * TICK_S
        bound_s = self._bound_s + _AHEAD_S * GOOD_DRIFT_ERROR if clock.good_drift is not None else inf
        return TickLine(tick, here.time_s + utc_offset_s, tick_s, min(ahead.error_s, bound_s))

    @property
    def error_s(self) -> float:
        """One standard deviation of the time told for now."""
        last_tick = self._last_ticks.get(self._boot, 0)
        now = self._clocks[self._boot].at(last_tick) if self._boot in self._clocks else None
        return now.error_s if now is not None else UNKNOWN_BOOT_ERROR_S

    @property
    def drift(self) -> float:
        """By how much the unit's oscillator is fast, seconds per second."""
        return self._clocks[self._boot].drift if self._boot in self._clocks else 0.0

    def good_drift(self, boot: int) -> float | None:
        """The drift that ``boot`` ran with, where that is known; else the present boot's: it is the same oscillator."""
        known = (self._clocks[each].good_drift for each in (boot, self._boot) if each in self._clocks)
        return next((drift for drift in known if drift is not None), None)

    def _unwrapped(self, boot: int, tick: int) -> int:
        """A tick as counted on where the unit's counter of 48 bits has begun again: the one nearest to the last known.

        A sweep may be told after a wrap that was made before it, and the other way round.
        """
        last_tick = self._last_ticks.get(boot, tick)
        return tick + (last_tick - tick + TICKS_TO_WRAP // 2) // TICKS_TO_WRAP * TICKS_TO_WRAP

    def _clock_of(self, boot: int, utc_offset_s: float) -> UnitClock:
        if boot not in self._clocks:
            found = self._anchor(boot)
            if found is None:
                self._clocks[boot] = self._make()
            else:
                tick, utc = found
                self._clocks[boot] = self._make(HostTime(utc.time_s - utc_offset_s, utc.error_s), tick)
                self._last_ticks[boot] = tick
        if self._boot in self._clocks:  # the present boot's is never the one to go
            self._clocks.move_to_end(self._boot)
        self._clocks.move_to_end(boot)
        if len(self._clocks) > _KEPT_BOOTS:
            forgotten, _ = self._clocks.popitem(last=False)
            self._last_ticks.pop(forgotten, None)
        return self._clocks[boot]
