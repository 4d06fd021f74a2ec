"""Times of sweeps from this boot and earlier ones. UTC is 1e9 s ahead of the host's monotonic clock here."""

from dataclasses import replace

import pytest
from gateway.oscillator import QUICK, TOLERANCE, Oscillator, exchanges

from noctule_gateway.clock.boot_clocks import UNKNOWN_BOOT_ERROR_S, BootClocks
from noctule_gateway.clock.regression import TICKS_TO_WRAP, HostTime
from noctule_gateway.link.peer import BootWatch

OFFSET_S = 1e9


def begun(anchors: dict[int, tuple[int, HostTime]] | None = None, boot: int = 5) -> BootClocks:
    clocks = BootClocks(nominal=False, anchor=(anchors or {}).get)
    clocks.begin(boot, 1000.0, OFFSET_S)
    return clocks


def test_a_sweep_of_an_earlier_boot_that_was_watched_keeps_that_boots_clock() -> None:
    clocks = begun()
    before = Oscillator(0.01)
    for exchange in exchanges(before, 60, seed=6):
        clocks.add(exchange)
    clocks.begin(6, 1101.0, OFFSET_S)
    for exchange in exchanges(Oscillator(0.01, booted_s=1100.0), QUICK, seed=7, begin_s=1101.0):
        clocks.add(exchange)
    told = clocks.at(5, before.tick(1050.0), OFFSET_S)
    assert told.time_s - OFFSET_S == pytest.approx(1050.0, abs=0.002)
    assert told.error_s < 0.002


def test_a_sweep_of_an_earlier_boot_is_told_from_the_log_with_the_oscillators_tolerance() -> None:
    anchor = (4_000_000, HostTime(OFFSET_S + 900.0, 0.001))
    clocks = begun({4: anchor})
    told = clocks.at(4, 44_000_000, OFFSET_S)
    assert told.time_s - OFFSET_S == pytest.approx(910.0)
    assert told.error_s == pytest.approx(10.0 * TOLERANCE, rel=0.01)


def test_a_sweep_of_a_boot_that_nothing_is_known_of_was_before_the_present_one() -> None:
    clocks = begun()
    for exchange in exchanges(Oscillator(0.0), QUICK, seed=8):
        clocks.add(exchange)
    told = clocks.at(4, 4_000_000, OFFSET_S)
    assert told.time_s - OFFSET_S == pytest.approx(990.0, abs=0.5)
    assert told.error_s == UNKNOWN_BOOT_ERROR_S


def test_utc_that_is_set_right_moves_the_times_told_and_not_the_clock() -> None:
    clocks = begun()
    unit = Oscillator(0.0)
    for exchange in exchanges(unit, 60, seed=9):
        clocks.add(exchange)
    before, after = (clocks.at(5, unit.tick(1040.0), offset_s) for offset_s in (OFFSET_S, OFFSET_S + 30))
    assert after.time_s - before.time_s == pytest.approx(30.0)
    assert after.error_s == before.error_s


def test_sweeps_of_many_earlier_boots_do_not_push_out_the_clock_of_the_present_one() -> None:
    clocks = begun(boot=50)
    for boot in range(30, 50):
        clocks.at(boot, 4_000_000, OFFSET_S)
    assert all(clocks.add(exchange) for exchange in exchanges(Oscillator(0.0), QUICK, seed=10))
    assert clocks.at(50, 4_000_000, OFFSET_S).error_s < UNKNOWN_BOOT_ERROR_S


def test_an_earlier_boot_that_was_not_watched_ran_on_the_same_oscillator() -> None:
    clocks = begun(boot=5)
    assert clocks.good_drift(5) is None
    for exchange in exchanges(Oscillator(0.01), 60, seed=11):
        clocks.add(exchange)
    assert clocks.good_drift(5) == pytest.approx(0.01, abs=1e-4)
    assert clocks.good_drift(4) == clocks.good_drift(5)


def test_right_after_a_reset_the_drift_of_the_boot_before_still_counts_for_its_own_sweeps_only() -> None:
    clocks = begun(boot=5)
    for exchange in exchanges(Oscillator(0.01), 60, seed=12):
        clocks.add(exchange)
    clocks.begin(6, 1101.0, OFFSET_S)
    assert clocks.good_drift(5) == pytest.approx(0.01, abs=1e-4)
    assert clocks.good_drift(6) is None


def test_times_go_on_where_a_units_counter_of_48_bits_begins_again() -> None:
    """firmware/README.md: a tick is modulo 2^48. Here it begins again 30 s after the first exchange."""
    unit = Oscillator(0.01)
    ahead = TICKS_TO_WRAP - unit.tick(1030.0)

    def shown(host_s: float) -> int:
        return (unit.tick(host_s) + ahead) % TICKS_TO_WRAP

    clocks, watch = begun(), BootWatch()
    watch.begin(5)
    for each in exchanges(unit, 70, seed=14):
        ticks = ((tick + ahead) % TICKS_TO_WRAP for tick in (each.received_tick, each.sent_tick))
        received_tick, sent_tick = ticks
        assert not watch.refuted_by_tick(sent_tick)
        assert clocks.add(replace(each, received_tick=received_tick, sent_tick=sent_tick))
    for host_s in (1025.0, 1029.9, 1030.1, 1050.0):
        told = clocks.at(5, shown(host_s), OFFSET_S)
        assert told.time_s - OFFSET_S == pytest.approx(host_s, abs=0.002)


def test_a_gateway_that_comes_after_a_wrap_tells_the_sweeps_of_before_it() -> None:
    unit, clocks = Oscillator(0.01), begun()
    for exchange in exchanges(unit, QUICK, seed=15):
        clocks.add(exchange)
    told = clocks.at(5, unit.tick(989.0) % TICKS_TO_WRAP, OFFSET_S)  # its counter began again at 990 s
    assert told.time_s - OFFSET_S == pytest.approx(989.0, abs=3 * told.error_s)
    assert told.error_s < 0.5


def test_a_sweep_in_the_log_of_before_a_wrap_tells_those_of_after_it() -> None:
    clocks = begun({4: (TICKS_TO_WRAP - 4_000_000, HostTime(OFFSET_S + 900.0, 0.001))})
    told = clocks.at(4, 36_000_000, OFFSET_S)
    assert told.time_s - OFFSET_S == pytest.approx(910.0)
    assert told.error_s == pytest.approx(10.0 * TOLERANCE, rel=0.01)
