"""A unit's time as the host's: regression of ticks over request and answer exchanges, with a stated error.

Each exchange bounds the unit's clock: what the unit stamped happened between the host's sending and its receiving.
The mid of that interval is a measurement with a known worst error, half the round trip, so that a delayed exchange
weighs little and one that contradicts the line by more than its bound is refused. Forgetting is exponential.
Host time is any clock in seconds; the tick is 0.25 us of the unit's own oscillator.
"""

from dataclasses import dataclass
from math import hypot, inf, sqrt
from typing import Protocol

TICK_S = 0.25e-6
TICKS_TO_WRAP = 2**48  # 2.2 years
OSCILLATOR_TOLERANCE = 0.015  # C8051F340 datasheet: the internal oscillator is within 1.5 %
MOST_DRIFT = 2 * OSCILLATOR_TOLERANCE  # more is not an oscillator's: a simulator that can't keep up

GOOD_DRIFT_ERROR = 2e-4  # 0.8 mm at the sensor's 4 m, a quarter of what a single range is off by

_DECAY = 0.95  # of all earlier weight, per exchange: some twenty seconds of memory at one a second
_WANDER = 5e-5  # assumed change of drift within that memory: the chip warms up, 7 K at 40 ppm/K within minutes
_REFUSALS_TO_BELIEVE = 3  # so many contradictions in a row: it is the line that is wrong
_JUMP_S = 0.1  # by less than this a unit's time may jitter, by more it is another time
_FLOOR_GROWTH = 1.01  # per exchange, so that a round trip that was short once does not count for ever
_MIN_HALF_TRIP_S = 10e-6  # below this the host's own stamps are the error


@dataclass(frozen=True)
class Exchange:
    """One CLOCK request and its answer: the host's times at both ends and the unit's stamps between them."""

    sent_s: float
    received_tick: int
    sent_tick: int
    answered_s: float

    @property
    def host_s(self) -> float:
        """Mid of the host's interval."""
        return (self.sent_s + self.answered_s) / 2

    @property
    def unit_s(self) -> float:
        """Mid of the unit's interval, nominal seconds since its boot."""
        return (self.received_tick + self.sent_tick) / 2 * TICK_S

    @property
    def half_trip_s(self) -> float:
        """Worst error of taking the two mids as the same moment; no exchange can be true where it is negative."""
        held_s = (self.sent_tick - self.received_tick) * TICK_S
        return (self.answered_s - self.sent_s - held_s) / 2


@dataclass(frozen=True)
class HostTime:
    """A moment of a unit in the host's seconds, with one standard deviation."""

    time_s: float
    error_s: float


class UnitClock(Protocol):
    """What tells a unit's time: either of the classes below."""

    @property
    def drift(self) -> float:
        """By how much the unit's oscillator is fast: nominal unit seconds per host second, less one."""
        ...

    @property
    def good_drift(self) -> float | None:
        """The drift, where it is known well enough to take it out of a sweep's times."""
        ...

    def add(self, exchange: Exchange) -> bool:
        """Take an exchange in; False if it was refused."""
        ...

    def at(self, tick: int) -> HostTime | None:
        """When ``tick`` was; None before the first exchange."""
        ...


class NominalClock:
    """Ticks of exactly 0.25 us, anchored once: for a simulated unit that runs at another speed than the host."""

    def __init__(self, anchor: HostTime | None = None, anchor_tick: int = 0) -> None:
        self._anchor = anchor
        self._anchor_unit_s = anchor_tick * TICK_S
        self.drift = 0.0
        self.good_drift: float | None = None  # one speed can't be told from the other

    def add(self, exchange: Exchange) -> bool:
        """Anchor to the first exchange, or to one before the anchor: that was of another boot under the same number."""
        if self._anchor is None or exchange.unit_s < self._anchor_unit_s:
            # At another speed the unit may seem to have held the request for longer than the round trip.
            self._anchor = HostTime(exchange.host_s, (exchange.answered_s - exchange.sent_s) / 2 / sqrt(3))
            self._anchor_unit_s = exchange.unit_s
        return True

    def at(self, tick: int) -> HostTime | None:
        """When ``tick`` was, in the host's seconds as the simulated world would have them."""
        if self._anchor is None:
            return None
        return HostTime(self._anchor.time_s + tick * TICK_S - self._anchor_unit_s, self._anchor.error_s)


class RegressedClock:
    """Exponentially weighted regression of host time on unit time.

    An anchor known from elsewhere (a sweep in the log) tells the time until the first exchange, with an error that
    grows by the oscillator's tolerance.
    """

    def __init__(self, anchor: HostTime | None = None, anchor_tick: int = 0) -> None:
        self._restart()
        if anchor is not None:
            self._mean_unit_s, self._mean_host_s = anchor_tick * TICK_S, anchor.time_s
            self._weight = 1 / anchor.error_s**2
            self._floor_s = self._bias_s = anchor.error_s

    @property
    def drift(self) -> float:
        """By how much the unit's oscillator is fast: nominal unit seconds per host second, less one."""
        return 1 / self._slope - 1

    @property
    def good_drift(self) -> float | None:
        """The drift, once it is known to GOOD_DRIFT_ERROR; None if it is more than an oscillator can have."""
        return self.drift if abs(self.drift) <= MOST_DRIFT and self._drift_error <= GOOD_DRIFT_ERROR else None

    def add(self, exchange: Exchange) -> bool:
        """Take an exchange in, unless it contradicts the line by more than its bound and the line's error allow."""
        if exchange.half_trip_s < -_MIN_HALF_TRIP_S or exchange.sent_tick < exchange.received_tick:
            return False
        half_trip_s = max(exchange.half_trip_s, _MIN_HALF_TRIP_S)
        if self._weight and not self._agrees(exchange, half_trip_s):
            return False
        self._refused = 0
        self._floor_s = min(half_trip_s, self._floor_s * _FLOOR_GROWTH)
        # A queue delays one way only, so it moves the mid to one side, time after time. Trips longer than the shortest
        # weigh little, and the mean half trip bounds the bias that is left.
        excess = half_trip_s / self._floor_s
        variance = half_trip_s**2 / 3 * excess**2 + self._jitter_s**2
        self._regress(exchange.unit_s, exchange.host_s, weight=1 / variance)
        share = (1 / variance) / self._weight
        self._bias_s += share * (half_trip_s - self._bias_s)
        return True

    def at(self, tick: int) -> HostTime | None:
        """When ``tick`` was; the error takes in that the two ways of the round trip may never have been equal."""
        if not self._weight:
            return None
        unit_s = tick * TICK_S
        return HostTime(self._host_s(unit_s), hypot(self._line_error_s(unit_s), self._jitter_s))

    @property
    def _slope(self) -> float:
        """Host seconds per nominal unit second; the oscillator's tolerance is what is known before the exchanges."""
        return 1 + self._covariance / (self._variance + OSCILLATOR_TOLERANCE**-2)

    def _host_s(self, unit_s: float) -> float:
        return self._mean_host_s + (unit_s - self._mean_unit_s) * self._slope

    @property
    def _drift_error(self) -> float:
        return hypot(1 / sqrt(self._variance + OSCILLATOR_TOLERANCE**-2), _WANDER)

    def _line_error_s(self, unit_s: float) -> float:
        ahead_s = unit_s - self._mean_unit_s
        return hypot(1 / sqrt(self._weight), self._drift_error * ahead_s, self._bias_s)

    def _agrees(self, exchange: Exchange, half_trip_s: float) -> bool:
        """The exchange fits the line, or the line has given way because exchanges have contradicted it in a row."""
        off_s = exchange.host_s - self._host_s(exchange.unit_s)
        line_error_s = self._line_error_s(exchange.unit_s)
        if abs(off_s) <= half_trip_s + 5 * hypot(line_error_s, self._jitter_s):
            explained = abs(off_s) <= half_trip_s + 2 * line_error_s
            self._jitter_s = sqrt(_DECAY * self._jitter_s**2 + (1 - _DECAY) * (0.0 if explained else off_s**2))
            return True
        self._refused += 1
        if self._refused < _REFUSALS_TO_BELIEVE:
            return False
        if abs(off_s) > _JUMP_S:
            self._restart()
        else:
            self._jitter_s = abs(off_s)
        return True

    def _restart(self) -> None:
        self._weight = 0.0
        self._mean_unit_s = self._mean_host_s = 0.0
        self._variance = self._covariance = 0.0  # weighted sums about the means: of unit_s, and with host_s - unit_s
        self._floor_s = inf
        self._bias_s = 0.0
        self._jitter_s = 0.0
        self._refused = 0

    def _regress(self, unit_s: float, host_s: float, weight: float) -> None:
        kept = self._weight * _DECAY
        self._weight = kept + weight
        ahead_s = unit_s - self._mean_unit_s if kept else 0.0
        gained_s = host_s - self._mean_host_s - ahead_s if kept else 0.0
        share = weight / self._weight
        self._variance = self._variance * _DECAY + kept * share * ahead_s**2
        self._covariance = self._covariance * _DECAY + kept * share * ahead_s * gained_s
        if kept:
            self._mean_unit_s += share * ahead_s
            self._mean_host_s += share * (ahead_s + gained_s)
        else:
            self._mean_unit_s, self._mean_host_s = unit_s, host_s
