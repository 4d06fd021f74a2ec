"""The host's wall clock is set: that is told for a while, once each time."""

import pytest

from noctule.elapsed import Instant
from noctule_gateway.clock.clock_watch import SHOWN_S, ClockWatch

DAY_S = 86400.0


@pytest.mark.parametrize(("set_s", "way"), [(40 * DAY_S, "forward"), (-40 * DAY_S, "back"), (10.0, "forward")])
def test_a_clock_that_is_set_is_told_once_and_shown_for_a_while(set_s: float, way: str) -> None:
    watch = ClockWatch()
    assert not watch.note(Instant(1e9, "boot", 5.0))
    assert watch.note(Instant(1e9 + 1 + set_s, "boot", 6.0))
    assert f"set {way} by {abs(set_s):.0f} s" in watch.detail
    assert not watch.note(Instant(1e9 + 2 + set_s, "boot", 7.0))
    assert watch.detail
    later_s = 7.0 + SHOWN_S
    assert not watch.note(Instant(1e9 - 5 + set_s + later_s, "boot", later_s))
    assert (watch.detail, watch.sets) == ("", 1)


def test_a_clock_that_runs_a_little_fast_for_days_was_not_set() -> None:
    watch = ClockWatch()
    for second in range(0, 10 * 86400, 60):
        assert not watch.note(
            Instant(1e9 + second * (1 + 500e-6), "boot", float(second))
        )  # the most that adjtime slews
