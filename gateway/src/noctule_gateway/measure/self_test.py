"""A test of a unit's parts: what it is ordered to do, and what its answers say of each part."""

from collections.abc import Sequence
from math import radians

from noctule.messages_pb2 import Measurement, UnitStatus
from noctule_gateway.clock.regression import TICK_S
from noctule_gateway.measure import play
from noctule_gateway.measure.edges import NEEDS_SWITCH, Edges, failure
from noctule_gateway.measure.figures import bad, good, unknown
from noctule_gateway.wire.frames import (
    NEVER,
    NO_TEMPERATURE,
    GoTo,
    Home,
    HomeKind,
    Measure,
    MeasureKind,
    Mechanics,
    Order,
    Settings,
)
from noctule_gateway.wire.settings_message import calibration_of
from noctule_gateway.wire.units import PER_RADIAN

_PINGS_DEG = range(-120, 121, 30)

_REFERENCE_V = 2.44
_SUPPLY_OVER_REFERENCE = (3.0 / 2.50, 3.6 / 2.38)  # the chip's limits of either (datasheet, from memory)
_CHIP_C = (-20.0, 70.0)
_SENSOR_SPREAD_C = 14.0  # of an untrimmed chip: firmware/README.md, TRIM_TEMPERATURE
_LOST = 3  # half steps; a slip is eight
_ROUNDS = 3  # as many steps may be lost up as down, but not thrice
_USUAL_LAG_S = 0.0025  # 0.45 to 2.3 ms after the trigger: firmware/README.md, Sensors, and turns/timetable.py, LAG_S
_NO_ECHO_S = 0.036  # a longer pulse is no echo
_OSCILLATOR = 0.015  # the C8051F340's own: +-1.5 %
_CLOCK_ERROR_S = 0.001


def steps(settings: Settings) -> list[Order]:
    """What the unit is to do, one after the other."""
    pings = [each for b in _PINGS_DEG for each in (GoTo(0, round(radians(b) * PER_RADIAN)), _PING)]
    if settings.home == HomeKind.STOP:
        return [Home(0), *pings]
    return [Measure(0, MeasureKind.PLAY), *_ROUNDS * [Measure(0, MeasureKind.ROUND)], *pings]


def measurements(found: Sequence[Mechanics], settings: Settings, status: UnitStatus) -> list[Measurement]:
    """What was ``found``, part by part, from the supply to the clock."""
    plays = [each for each in found if each.kind == MeasureKind.PLAY]
    rounds = [each for each in found if each.kind == MeasureKind.ROUND]
    pings = [each for each in found if each.kind == MeasureKind.PING]
    return [
        *([_supply(found[-1])] if found else []),
        _temperature(status, trimmed=settings.temperature_trim != NO_TEMPERATURE),
        *_mechanics(plays, rounds, settings),
        *_echo(pings),
        _clock(status),
    ]


_PING = Measure(0, MeasureKind.PING)


def _supply(mechanics: Mechanics) -> Measurement:
    ratio = 1 + mechanics.supply / 512
    supply_v = _REFERENCE_V * ratio
    words = f"{supply_v:.2f} V, if the chip's reference is at its {_REFERENCE_V} V"
    if _SUPPLY_OVER_REFERENCE[0] <= ratio <= _SUPPLY_OVER_REFERENCE[1]:
        return good("supply_v", words, supply_v)
    return bad("supply_v", f"{words}: measure the 3.3 V and P1.5, and check its two capacitors", supply_v)


def _temperature(status: UnitStatus, trimmed: bool) -> Measurement:
    if not status.HasField("chip_temperature_c"):
        return unknown("chip_temperature_c", "not measured yet: it takes two seconds from a reset")
    chip_c = status.chip_temperature_c
    words = f"{chip_c:.1f} degrees C"
    if not trimmed:
        words += f", not trimmed: it may be off by {_SENSOR_SPREAD_C:.0f} (trim_temperature)"
    if _CHIP_C[0] <= chip_c <= _CHIP_C[1]:
        return good("chip_temperature_c", words, chip_c)
    return bad("chip_temperature_c", f"{words}: no room is like that; check the 3.3 V and P1.5", chip_c)


def _mechanics(plays: list[Mechanics], rounds: list[Mechanics], settings: Settings) -> list[Measurement]:
    names = ("home_switch", play.NAME, "round_half_steps_lost")
    if settings.home == HomeKind.STOP:
        return [unknown(name, NEEDS_SWITCH) for name in names]
    for each in plays:
        if (why := failure(each)) is not None:
            return [bad(names[0], why), *(unknown(name, "not tested: home was not found") for name in names[1:])]
    switch = good(names[0], "it opens and closes")
    if any(play.play_of(each) is None for each in plays):
        switch = bad(names[0], "it did not open and close: check it, its wire and the motor")
    return [switch, play.measurement(plays, calibration_of(settings)), _round(names[2], plays, rounds)]


def _round(name: str, plays: list[Mechanics], rounds: list[Mechanics]) -> Measurement:
    known = play.play_of(plays[0]) if plays else None
    failed = next((why for each in rounds if (why := failure(each)) is not None), None)
    if known is None or not rounds or failed is not None:
        return unknown(name, failed or "not tested")
    if any(len(Edges.of(each).up) > 1 for each in rounds):
        return bad(name, "it came home before the way was over: the wrong gear? measure_gear tells")
    found = [_between(each) for each in rounds]
    if any(each is None for each in found):
        return bad(name, "it did not come home again: the motor loses steps, or something holds the sensor")
    lost = max((each - known - 1 for each in found if each is not None), key=abs)
    words = f"{lost:+d} half steps after 292 degrees up and down at the plan's speed"
    if abs(lost) <= _LOST:
        return good(name, words, lost)
    return bad(name, f"{words}: the motor loses steps; check its 5 V and what may brake it, lower its speed", lost)


def _between(mechanics: Mechanics) -> int | None:
    """Half steps from where the switch opened to where it closed."""
    edges = Edges.of(mechanics)
    return edges.up[0] - edges.down[-1] if edges.up and edges.down else None


def _echo(pings: list[Mechanics]) -> list[Measurement]:
    lags_s = [each.lag * TICK_S for each in pings if each.lag != NEVER]
    widths_s = [each.width * TICK_S for each in pings if each.width != NEVER]
    return [_lag(lags_s, len(pings)), _no_echo(widths_s, len(lags_s))]


def _lag(lags_s: list[float], pings: int) -> Measurement:
    name = "echo_lag_s"
    if not lags_s:
        return bad(name, "the echo line never rose by itself: check the sensor's plug, its 5 V, TRIG and ECHO")
    if len(lags_s) < pings:
        return bad(name, f"the echo line did not rise after {pings - len(lags_s)} of {pings} pings: check its wires")
    words = f"ECHO rises {min(lags_s) * 1e3:.2f} to {max(lags_s) * 1e3:.2f} ms after the trigger"
    if max(lags_s) > _USUAL_LAG_S:  # nothing is wrong with it, by itself
        words += ": its unit must not share a room with units of ordinary sensors, since turns reckon with 2 ms"
    return good(name, words, max(lags_s))


def _no_echo(widths_s: list[float], rises: int) -> Measurement:
    name = "no_echo_s"
    if len(widths_s) < rises:
        return bad(name, f"ECHO did not fall within 250 ms, {rises - len(widths_s)} times: fit the transistor at P1.6")
    silent_s = [each for each in widths_s if each > _NO_ECHO_S]
    if not silent_s:
        return unknown(name, f"all {len(widths_s)} bearings answered, so it did not show")
    return good(name, f"without an echo ECHO lasts {max(silent_s) * 1e3:.0f} ms", max(silent_s))


def _clock(status: UnitStatus) -> Measurement:
    name = "clock_drift"
    words = (
        f"the unit's clock is {abs(status.clock_drift) * 1e6:.0f} ppm {'fast' if status.clock_drift > 0 else 'slow'}"
    )
    if not 0 < status.clock_error_s <= _CLOCK_ERROR_S:
        return unknown(name, f"{words}, not known well yet: {status.clock_error_s * 1e3:.1f} ms", status.clock_drift)
    if abs(status.clock_drift) <= _OSCILLATOR:
        return good(name, f"{words}, by the host", status.clock_drift)
    return bad(name, f"{words}: more than its oscillator's 1.5 %; replace the board", status.clock_drift)
